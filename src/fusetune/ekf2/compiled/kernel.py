"""How the estimator's functions are compiled.

`kernel` marks every compiled function, `entry_kernel` the one that the others are reached through. Only the entry is
cached: its object code holds all that it calls. Arithmetic is strict IEEE 754 double precision (no fast-math), with
division by zero giving inf or NaN as in NumPy.

Kernels allocate nothing, so they do without Numba's reference counting of arrays, which would take a third of the
time; one that does allocate does not compile.
"""

from numba import njit

kernel = njit(error_model="numpy", _nrt=False)  # type: ignore[call-overload]
entry_kernel = njit(error_model="numpy", cache=True, nogil=True, _nrt=False)  # type: ignore[call-overload]
