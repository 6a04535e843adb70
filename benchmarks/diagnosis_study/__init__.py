"""Does the diagnosis name what is wrong? `python -m benchmarks.diagnosis_study --help`."""

from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache

# Numba reads where its cache is when it is imported.
use_kernel_cache()
