cimport cython

from posed.fusion.adaptive_bias cimport BiasState
from posed.fusion.adaptive_field cimport FieldState
from posed.fusion.adaptive_heading cimport HeadingState
from posed.fusion.adaptive_interval cimport IntervalState
from posed.fusion.adaptive_iron cimport IronState
from posed.fusion.adaptive_repeats cimport Repeats
from posed.fusion.adaptive_tilt cimport TiltState
from posed.fusion.direction_cosines cimport DirectionCosines
from posed.fusion.event_arrays cimport HeldEvents
from posed.fusion.rest cimport RestState

cdef long long _GAP
cdef long long _BAD_SAMPLE

@cython.final
cdef class AdaptiveState:
    cdef public DirectionCosines matrix
    cdef public bint started
    cdef public bint has_time
    cdef public long long time_ns
    cdef public long long start_ns
    cdef public long long first_ns
    cdef public long long newest_ns
    cdef public bint ahead
    cdef public bint has_gyro
    cdef public long long gyro_ns
    cdef public Repeats gyro_repeats
    cdef public bint unsteady
    cdef public bint gyro_lost
    cdef public bint has_acc
    cdef public long long acc_ns
    cdef public long long acc_used_ns
    cdef public Repeats acc_repeats
    cdef public bint has_mag
    cdef public long long mag_ns
    cdef public long long mag_used_ns
    cdef public Repeats mag_repeats
    cdef public bint earth_gap
    cdef public bint free_fall
    cdef public long long events
    cdef public long long bad_samples
    cdef public long long gaps
    cdef public HeldEvents held
    cdef public IntervalState interval
    cdef public TiltState tilt
    cdef public RestState rest
    cdef public BiasState bias
    cdef public FieldState earth
    cdef public IronState iron
    cdef public HeadingState heading

    cpdef void flag_gap(self) noexcept
    cpdef void flag_bad_sample(self) noexcept
