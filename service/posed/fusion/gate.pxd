cimport cython

@cython.final
cdef class GateState:
    cdef public double reference_s
    cdef public double reference_norm
    cdef public double reference_dip
    cdef public double candidate_s
    cdef public double candidate_norm
    cdef public double candidate_dip
    cdef public double rejected_s
    cdef public bint disturbed

@cython.final
cdef class MagneticGate:
    cdef readonly GateState state
    cdef bint _enabled
    cdef double _norm_tolerance
    cdef double _dip_tolerance
    cdef double _reference_s
    cdef double _candidate_s
    cdef double _patience_s
    cdef double _late_weight

    cpdef void start(self, double norm, double dip, double dt) noexcept
    cpdef double weight(self, double norm, double dip, double dt, bint at_rest) noexcept
    cdef bint _candidate_holds(self, double norm, double dip, double dt, bint at_rest) noexcept
