cimport cython

@cython.final
cdef class RestState:
    cdef public bint at_rest
    cdef public double still_s
    cdef public bint has_rate
    cdef public double rate_x
    cdef public double rate_y
    cdef public double rate_z
    cdef public bint has_acceleration
    cdef public double acceleration_x
    cdef public double acceleration_y
    cdef public double acceleration_z
    cdef public bint shaken
    cdef public double bias_x
    cdef public double bias_y
    cdef public double bias_z
    cdef public double bias_variance

@cython.final
cdef class RestBias:
    cdef readonly RestState state
    cdef bint _learn_bias
    cdef double _rate_deviation2
    cdef double _acceleration_deviation2
    cdef double _mean_s
    cdef double _settle_s
    cdef double _bias_limit2
    cdef double _bias_max
    cdef double _bias_walk
    cdef double _rest_noise

    cpdef void take_rate(self, double x, double y, double z, double dt) noexcept
    @cython.locals(first=bint)
    cpdef void take_acceleration(self, double x, double y, double z, double dt) noexcept
    cpdef void moved(self) noexcept
