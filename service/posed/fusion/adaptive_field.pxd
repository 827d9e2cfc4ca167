cimport cython

@cython.final
cdef class FieldState:
    cdef public bint known
    cdef public double norm
    cdef public double dip
    cdef public double reference_age_s
    cdef public double reference_norm
    cdef public double reference_dip
    cdef public double candidate_age_s
    cdef public double candidate_norm
    cdef public double candidate_dip
    cdef public double good_s
    cdef public double rejected_s
    cdef public bint disturbed

@cython.final
cdef class FieldGate:
    cdef readonly FieldState state
    cdef double _norm_tolerance
    cdef double _dip_tolerance
    cdef double _mean_s
    cdef double _settle_s
    cdef double _reference_s
    cdef double _candidate_s
    cdef double _candidate_rate2
    cdef double _patience_s
    cdef double _late_weight

    cpdef void start(self, double norm, double dip) noexcept
    cpdef double weight(self, double norm, double dip, double dt, double rate2) noexcept
    cdef void _try_candidate(self, double dt, double rate2) noexcept
