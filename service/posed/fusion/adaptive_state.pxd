cimport cython

from posed.fusion.adaptive_bias cimport BiasState
from posed.fusion.adaptive_field cimport FieldState
from posed.fusion.adaptive_heading cimport HeadingState
from posed.fusion.adaptive_interval cimport IntervalState
from posed.fusion.adaptive_iron cimport IronState
from posed.fusion.adaptive_tilt cimport TiltState
from posed.fusion.direction_cosines cimport DirectionCosines
from posed.fusion.event_arrays cimport HeldEvents
from posed.fusion.rest cimport RestState

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
    cdef public long long gyro_same
    cdef public double gyro_same_s
    cdef public bint unsteady
    cdef public double gyro_x
    cdef public double gyro_y
    cdef public double gyro_z
    cdef public bint gyro_lost
    cdef public bint has_acc
    cdef public long long acc_ns
    cdef public long long acc_used_ns
    cdef public long long acc_same
    cdef public double acc_same_s
    cdef public double acc_x
    cdef public double acc_y
    cdef public double acc_z
    cdef public bint has_mag
    cdef public long long mag_ns
    cdef public long long mag_used_ns
    cdef public long long mag_same
    cdef public double mag_same_s
    cdef public double mag_x
    cdef public double mag_y
    cdef public double mag_z
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
