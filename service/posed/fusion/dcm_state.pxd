cimport cython

from posed.fusion.direction_cosines cimport DirectionCosines
from posed.fusion.gate cimport GateState
from posed.fusion.event_arrays cimport HeldEvents
from posed.fusion.rest cimport RestState

cdef long long _GAP
cdef long long _BAD_SAMPLE

@cython.final
cdef class DcmState:
    cdef public DirectionCosines matrix
    cdef public double tilt_variance
    cdef public double heading_variance
    cdef public bint started
    cdef public bint has_up
    cdef public bint has_north
    cdef public bint has_time
    cdef public long long time_ns
    cdef public long long heading_ns
    cdef public bint has_gyro
    cdef public long long gyro_ns
    cdef public bint has_acc
    cdef public long long acc_ns
    cdef public bint has_mag
    cdef public long long mag_ns
    cdef public double rate_x
    cdef public double rate_y
    cdef public double rate_z
    cdef public bint gyro_lost
    cdef public bint free_fall
    cdef public long long events
    cdef public long long bad_samples
    cdef public long long gaps
    cdef public HeldEvents held
    cdef public RestState rest
    cdef public GateState gate

    cpdef void flag_gap(self) noexcept
    cpdef void flag_bad_sample(self) noexcept
