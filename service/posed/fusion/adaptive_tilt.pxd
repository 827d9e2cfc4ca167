cimport cython

from posed.fusion.direction_cosines cimport DirectionCosines

cdef extern from "math.h":
    cpdef double sqrt(double x)

@cython.final
cdef class TiltState:
    cdef public bint known
    cdef public double age_s
    cdef public double length
    cdef public double slope_x
    cdef public double slope_y
    cdef public double slope_z
    cdef public double frequency
    cdef public double turn_x
    cdef public double turn_y

@cython.final
cdef class Tilt:
    cdef readonly TiltState state
    cdef double _time_s
    cdef double _two_damping
    cdef double _interval_noise
    cdef double _lost_s

    cpdef void start(self, DirectionCosines c, double x, double y, double z, double dt) noexcept
    cpdef void resume(self) noexcept
    cpdef bint level(
        self, DirectionCosines c, double x, double y, double z, double dt, bint lost, double interval_error
    ) noexcept
