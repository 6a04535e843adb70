"""How the estimator's functions are compiled.

`kernel` marks every compiled function, `entry_kernel` the one that the others are reached through. Only the entry is
cached: its object code holds all that it calls. Arithmetic is strict IEEE 754 double precision (no fast-math), with
division by zero giving inf or NaN as in NumPy.
"""

from numba import njit

kernel = njit(error_model="numpy")
entry_kernel = njit(error_model="numpy", cache=True)
