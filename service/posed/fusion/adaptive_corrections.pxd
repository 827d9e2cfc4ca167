cimport cython

from posed.fusion.adaptive_bias cimport GyroBias
from posed.fusion.adaptive_field cimport FieldGate
from posed.fusion.adaptive_heading cimport Heading
from posed.fusion.adaptive_interval cimport GyroInterval, IntervalState
from posed.fusion.adaptive_iron cimport HardIron, IronState
from posed.fusion.adaptive_repeats cimport Repeats
from posed.fusion.adaptive_state cimport AdaptiveState
from posed.fusion.adaptive_tilt cimport Tilt, TiltState
from posed.fusion.direction_cosines cimport DirectionCosines
from posed.fusion.rest cimport RestBias, RestState
from posed.fusion.three_state cimport ThreeState

cdef extern from "math.h":
    cpdef double sqrt(double x)

cdef long long _ACCELEROMETER
cdef double _MAX_STEP_S
cdef double _FIRST_STEP_S
cdef double _UNSTEADY
cdef double _MIN_ACCELERATION2
cdef double _MIN_HORIZONTAL2

@cython.final
cdef class Corrections:
    cdef readonly AdaptiveState state
    cdef readonly GyroInterval interval
    cdef readonly Tilt tilt
    cdef readonly RestBias rest
    cdef readonly GyroBias bias
    cdef readonly FieldGate earth
    cdef readonly HardIron iron
    cdef readonly Heading heading
    cdef double _tilt_time_s
    cdef double _two_damping

    cdef void measure(self, long long sensor_type, long long t, double x, double y, double z, double u) noexcept
    @cython.locals(
        s=AdaptiveState, c=DirectionCosines, tilt=TiltState, rest=RestState, repeats=Repeats, interval=GyroInterval, dt=double, norm2=double, change=double,
        east_x=double, east_y=double, east_z=double, levelled=bint,
    )
    cdef void _gravity(self, long long t, double x, double y, double z, double u) noexcept
    @cython.locals(
        s=AdaptiveState, c=DirectionCosines, interval=GyroInterval, interval_state=IntervalState, iron=IronState,
        b=ThreeState, repeats=Repeats, earth=FieldGate, dt=double, weight=double,
    )
    cdef void _north(self, long long t, double x, double y, double z, double u) noexcept
