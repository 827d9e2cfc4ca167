cimport cython

cdef extern from "math.h":
    cpdef double sqrt(double x)

@cython.final
cdef class HeadingState:
    cdef public bint known
    cdef public double north_x
    cdef public double north_y
    cdef public double variance

@cython.final
cdef class Heading:
    cdef readonly HeadingState state
    cdef double _field_noise
    cdef double _steady
    cdef double _bias_s
    cdef double _lost2

    cpdef void wander(self, double dt, double bias_variance, double interval_variance) noexcept
    cpdef void wander_lost(self, double dt) noexcept
    cpdef void start(self, double x, double y, double dt) noexcept
    cpdef void follow(self, double x, double y, double dt, double weight) noexcept
