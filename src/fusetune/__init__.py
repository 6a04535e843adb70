"""Choose PX4 EKF2 parameters from flight logs, without ground truth.

The names below are for scripts and notebooks::

    import fusetune as ft

    ft.read("log.ulg").replay({"EKF2_GPS_DELAY": 160}).innovations
"""

import os
from importlib import import_module

__version__ = "0.1.0"

__all__ = [
    "Comparison",
    "Decision",
    "DiagnosedFlight",
    "Found",
    "Log",
    "Replay",
    "UserError",
    "compare",
    "decide",
    "diagnose",
    "read",
    "search",
]

# Arrow's own allocators hold on to what was freed, of a small log several times its size. It reads this once, when it
# is loaded.
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")


# What the rules of the workflow import must stay light, so the names are looked up when they are asked for; their types
# stand in __init__.pyi.
def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name != "UserError":
        # read when NumPy is first imported; the matrices are too small for threads, which would only cost time
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    found = getattr(import_module("fusetune.errors" if name == "UserError" else "fusetune.library"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
