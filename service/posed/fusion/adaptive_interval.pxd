cimport cython

cdef extern from "math.h":
    cpdef double sqrt(double x)
    cpdef double sin(double x)
    cpdef double cos(double x)

cdef double _EVEN
cdef double _ERROR_MEAN_S

@cython.final
cdef class IntervalState:
    cdef public double length_s
    cdef public double rate_x
    cdef public double rate_y
    cdef public double rate_z
    cdef public bint has_before
    cdef public double before_x
    cdef public double before_y
    cdef public double before_z
    cdef public double error_rate

@cython.final
cdef class GyroInterval:
    cdef readonly IntervalState state
    cdef bint _slope
    cdef bint _own_time
    cdef double _loss2
    cdef readonly double error2
    cdef readonly double x
    cdef readonly double y
    cdef readonly double z
    cdef double _wx
    cdef double _wy
    cdef double _wz
    cdef double _slope_x
    cdef double _slope_y
    cdef double _slope_z
    cdef double _cone_x
    cdef double _cone_y
    cdef double _cone_z

    cpdef void begin(self, double x, double y, double z) noexcept
    cpdef void push(self, double x, double y, double z, double dt) noexcept
    cpdef void close(
        self, double next_x, double next_y, double next_z, double dt, double bias_x, double bias_y, double bias_z
    ) noexcept
    cpdef void turn(self, double u) noexcept
    cpdef void carry(self, double x, double y, double z, double u) noexcept
    cpdef void bring(self, double x, double y, double z, double u) noexcept
    cdef void _rotate(self, double x, double y, double z, double tx, double ty, double tz) noexcept
    cpdef (double, double, double) look_ahead(self, double bias_x, double bias_y, double bias_z, double further_s) noexcept
    cdef bint _even(self, double dt) noexcept
