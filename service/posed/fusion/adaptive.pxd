cimport cython

from posed.fusion.adaptive_corrections cimport Corrections
from posed.fusion.adaptive_heading cimport Heading
from posed.fusion.adaptive_interval cimport GyroInterval
from posed.fusion.adaptive_state cimport AdaptiveState
from posed.fusion.direction_cosines cimport DirectionCosines
from posed.fusion.event_arrays cimport EventArrays, HeldEvents
from posed.fusion.rest cimport RestBias
from posed.fusion.three_state cimport ThreeState

cdef extern from "math.h":
    cpdef double sqrt(double x)

cdef long long _ACCELEROMETER
cdef long long _MAGNETIC_FIELD
cdef long long _GYROSCOPE
cdef long long _MAX_STEP_NS
cdef long long _MAX_LATE_NS
cdef long long _MAX_TIME_NS
cdef double _MAX_STEP_S
cdef Py_ssize_t _MAX_HELD
cdef double _MAX_MEASUREMENT2

@cython.final
cdef class AdaptiveFilter:
    cdef readonly str name
    cdef readonly object params
    cdef readonly AdaptiveState state
    cdef bint _use_gyroscope
    cdef bint _use_magnetometer
    cdef double _gyro_delay_s
    cdef double _saturated_rate
    cdef double _max_rate
    cdef double _turning2
    cdef long long _acc_late_ns
    cdef long long _mag_late_ns
    cdef Corrections _corrections
    cdef GyroInterval _interval
    cdef RestBias _rest
    cdef Heading _heading

    @cython.locals(
        sensor_type=cython.longlong, timestamp_ns=cython.longlong, x=double, y=double, z=double,
        rows=EventArrays, k=Py_ssize_t,
    )
    cpdef update_batch(self, events)

    @cython.locals(s=AdaptiveState, held=HeldEvents, newest=cython.longlong, norm2=double, largest=double)
    cdef void _take(self, long long sensor_type, long long t, double x, double y, double z) noexcept
    cdef void _see(self, long long t) noexcept
    cdef void _believe(self, long long t) noexcept
    @cython.locals(
        s=AdaptiveState, c=DirectionCosines, step=cython.longlong, dt=double, norm2=double, about_up=double, turning=bint,
    )
    cdef void _take_rate(self, long long t, double x, double y, double z) noexcept
    @cython.locals(
        s=AdaptiveState, interval=GyroInterval, bias=ThreeState, held=HeldEvents, c=DirectionCosines,
        count=Py_ssize_t, k=Py_ssize_t, time_ns=cython.longlong, at_ns=cython.longlong, u=double, length=double,
    )
    cdef void _close(self, double next_x, double next_y, double next_z, double dt) noexcept
    @cython.locals(held=HeldEvents, count=Py_ssize_t, k=Py_ssize_t)
    cdef void _lose_gyro(self) noexcept
    @cython.locals(step=cython.longlong)
    cdef void _measure_alone(self, long long sensor_type, long long t, double x, double y, double z) noexcept
    cdef void _restart(self, long long t) noexcept
