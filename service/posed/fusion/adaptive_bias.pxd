cimport cython

from posed.fusion.direction_cosines cimport DirectionCosines
from posed.fusion.three_state cimport ThreeState

@cython.final
cdef class BiasState:
    cdef public ThreeState estimate
    cdef public double east_x
    cdef public double east_y
    cdef public double east_z
    cdef public double north_x
    cdef public double north_y
    cdef public double north_z
    cdef public double east_slope_x
    cdef public double east_slope_y
    cdef public double east_slope_z
    cdef public double north_slope_x
    cdef public double north_slope_y
    cdef public double north_slope_z
    cdef public double waited_s
    cdef public double turned_x
    cdef public double turned_y

@cython.final
cdef class GyroBias:
    cdef readonly BiasState state
    cdef double _variance
    cdef double _walk2
    cdef double _limit
    cdef double _rest2
    cdef double _motion2
    cdef double _step_s

    cpdef void start_rows(self, DirectionCosines c) noexcept
    cpdef bint due(self, double turn_x, double turn_y, double dt) noexcept
    cpdef void follow(self, DirectionCosines c, double w, double two_damping) noexcept
    cpdef void observe_rest(self, double x, double y, double z) noexcept
    cpdef void observe_motion(self) noexcept
    cpdef void skip(self) noexcept
    cdef void _end_step(self) noexcept
    cdef double _noise(self, double variance, double dt) noexcept
    cdef double _clipped(self, double value) noexcept
