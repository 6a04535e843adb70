"""The execute room: a simulated vehicle flies a mission and leaves a real ULog.

The truth is built from continuous kinematics on the rotating WGS-84 earth and the sensors are modelled on that truth.
Nothing here shares physics with the estimator; only `onboard_estimator` runs it, as the vehicle itself would.

The simulation is loaded when it is asked for: the workflow reads vehicle files whenever it starts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fusetune.execute.simulation import simulate

__all__ = ["simulate"]


def __getattr__(name: str) -> Any:
    if name == "simulate":
        from fusetune.execute.simulation import simulate

        return simulate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
