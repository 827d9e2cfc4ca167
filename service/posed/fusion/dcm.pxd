cimport cython

from posed.fusion.dcm_state cimport DcmState
from posed.fusion.direction_cosines cimport DirectionCosines
from posed.fusion.gate cimport MagneticGate
from posed.fusion.event_arrays cimport EventArrays, HeldEvents
from posed.fusion.rest cimport RestBias, RestState

cdef extern from "math.h":
    cpdef double sqrt(double x)
    cpdef double atan2(double y, double x)

cdef long long _ACCELEROMETER
cdef long long _MAGNETIC_FIELD
cdef long long _GYROSCOPE
cdef long long _MAX_STEP_NS
cdef long long _MAX_TIME_NS
cdef double _MAX_STEP_S
cdef double _FIRST_STEP_S
cdef Py_ssize_t _MAX_HELD
cdef double _MIN_ACCELERATION2
cdef double _MAX_MEASUREMENT2
cdef double _MAX_RATE2
cdef double _MIN_HORIZONTAL2

@cython.final
cdef class DcmFilter:
    cdef readonly object params
    cdef readonly DcmState state
    cdef double _gravity
    cdef double _gyro_white
    cdef double _gyro_moving
    cdef double _gyro_lost
    cdef double _acc_white
    cdef double _acc_moving
    cdef double _mag_white
    cdef double _mag_moving
    cdef RestBias _rest
    cdef MagneticGate _gate

    @cython.locals(
        sensor_type=cython.longlong, timestamp_ns=cython.longlong, x=double, y=double, z=double,
        rows=EventArrays, k=Py_ssize_t,
    )
    cpdef update_batch(self, events)

    cdef void _take(self, long long sensor_type, long long t, double x, double y, double z) noexcept

    @cython.locals(s=DcmState, rest=RestState, held=HeldEvents, time_ns=cython.longlong, count=Py_ssize_t, k=Py_ssize_t)
    cdef void _take_rate(self, long long t, double x, double y, double z) noexcept

    @cython.locals(held=HeldEvents, count=Py_ssize_t, k=Py_ssize_t)
    cdef void _lose_gyro(self) noexcept

    cdef void _measure_alone(self, long long sensor_type, long long t, double x, double y, double z) noexcept
    cdef void _measure(self, long long sensor_type, long long t, double x, double y, double z) noexcept
    cdef void _propagate_to(self, long long t) noexcept
    cdef void _correct_tilt(self, long long t, double x, double y, double z) noexcept
    cdef void _correct_heading(self, long long t, double x, double y, double z) noexcept
    cdef double _heading_variance(self) noexcept
    cdef void _restart(self, long long t) noexcept
