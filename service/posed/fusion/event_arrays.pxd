cimport cython

@cython.final
cdef class EventArrays:
    cdef readonly Py_ssize_t count
    cdef tuple _given
    cdef const long long[::1] sensor_type
    cdef const long long[::1] timestamp_ns
    cdef const double[::1] x
    cdef const double[::1] y
    cdef const double[::1] z

@cython.final
cdef class HeldEvents:
    cdef public Py_ssize_t count
    cdef long long[::1] sensor_type
    cdef long long[::1] timestamp_ns
    cdef double[::1] x
    cdef double[::1] y
    cdef double[::1] z

    @cython.locals(k=Py_ssize_t)
    cpdef void add(self, long long sensor_type, long long timestamp_ns, double x, double y, double z) noexcept

    @cython.locals(k=Py_ssize_t)
    cpdef list events(self)
