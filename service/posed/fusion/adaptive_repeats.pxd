cimport cython

cdef double _STUCK_S
cdef long long _STUCK_SAMPLES

@cython.final
cdef class Repeats:
    cdef public double x
    cdef public double y
    cdef public double z
    cdef public long long count
    cdef public double moved_s

    cpdef bint take(self, double x, double y, double z, bint first) noexcept
    cpdef bint stuck(self) noexcept
