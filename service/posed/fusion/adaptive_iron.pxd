cimport cython

from posed.fusion.three_state cimport ThreeState

cdef extern from "math.h":
    cpdef double sqrt(double x)

@cython.final
cdef class IronState:
    cdef public ThreeState estimate
    cdef public bint known
    cdef public double waited_s
    cdef public double age_s
    cdef public double vertical
    cdef public double up_x
    cdef public double up_y
    cdef public double up_z
    cdef public double raw_norm
    cdef public double raw_vertical
    cdef public double raw_variance
    cdef public double corrected_norm
    cdef public double corrected_vertical
    cdef public double corrected_variance
    cdef public double use

@cython.final
cdef class HardIron:
    cdef readonly IronState state
    cdef double _variance
    cdef double _walk2
    cdef double _mean_s
    cdef double _noise2
    cdef double _trial_s
    cdef double _worse
    cdef double _better
    cdef double _step_s

    cpdef bint due(self, double dt) noexcept
    cpdef void learn(self, double x, double y, double z, double ux, double uy, double uz) noexcept
    cdef void _judge(
        self, double x, double y, double z, double vertical, double ux, double uy, double uz, double dt
    ) noexcept
