cimport cython

@cython.final
cdef class ThreeState:
    cdef public double x
    cdef public double y
    cdef public double z
    cdef public double xx
    cdef public double xy
    cdef public double xz
    cdef public double yy
    cdef public double yz
    cdef public double zz

    cpdef void start(self, double variance) noexcept
    cpdef void doubt(self, double variance, double most) noexcept
    cpdef void observe(self, double hx, double hy, double hz, double residual, double noise) noexcept
    cpdef double variance_along(self, double hx, double hy, double hz) noexcept
