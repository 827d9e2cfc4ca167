cimport cython

cdef extern from "math.h":
    cpdef double sqrt(double x)
    cpdef double sin(double x)
    cpdef double cos(double x)

cdef long long _TURNS_TO_ROUNDING

@cython.final
cdef class DirectionCosines:
    cdef public double north_x
    cdef public double north_y
    cdef public double north_z
    cdef public double up_x
    cdef public double up_y
    cdef public double up_z
    cdef public long long turns

    cpdef void rotate(self, double x, double y, double z) noexcept
    cpdef void rebuild(
        self, double ux, double uy, double uz, double gain, double north_x, double north_y, double north_z
    ) noexcept
    cpdef void face(self, double ux, double uy, double uz) noexcept
    cpdef void tilt(self, double x, double y, double z) noexcept
    cpdef (double, double, double, double) quaternion(self) noexcept
    cdef void _undo_rounding(self) noexcept
