cimport cython

cdef extern from "math.h":
    cpdef double sqrt(double x)

@cython.final
cdef class FieldState:
    cdef public bint known
    cdef public double horizontal
    cdef public double vertical
    cdef public double reference_age_s
    cdef public double reference_horizontal
    cdef public double reference_vertical
    cdef public double candidate_age_s
    cdef public double candidate_horizontal
    cdef public double candidate_vertical
    cdef public double good_s
    cdef public double rejected_s
    cdef public bint disturbed

@cython.final
cdef class FieldGate:
    cdef readonly FieldState state
    cdef double _norm_tolerance
    cdef double _dip_cosine
    cdef double _mean_s
    cdef double _settle_s
    cdef double _reference_s
    cdef double _candidate_s
    cdef double _candidate_rate2
    cdef double _patience_s
    cdef double _late_weight

    cpdef void start(self, double horizontal, double vertical) noexcept
    cpdef void resume(self, double horizontal, double vertical) noexcept
    cpdef double weight(self, double horizontal, double vertical, double dt, double rate2) noexcept
    cdef bint _alike(self, double horizontal, double vertical) noexcept
    cdef void _try_candidate(self, double dt, double rate2) noexcept
