"""A second simulator, for worlds that the first one's makers did not have in mind when they built the decision.

It shares no motion and no sensor with `fusetune.execute`, only PX4's estimator aboard where a log is to hold its state.
Its flights are smooth curves in closed form instead of missions, its truth is differentiated exactly, and its sensors
err in other ways: misaligned axes, a bias that follows temperature, vibration with a resonance, a barometer that feels
the airspeed, a receiver of another delay than was told.
"""

from .flight import fly
from .settings import SecondWorld, second_world

__all__ = ["SecondWorld", "fly", "second_world"]
