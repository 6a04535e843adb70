"""Names of the manoeuvre classes; the configuration asks this module, so it imports nothing."""

from __future__ import annotations

GROUND, TAKEOFF, HOVER, STRAIGHT = "ground", "takeoff", "hover", "straight"
TURN, CLIMB, DESCENT, LANDING = "turn", "climb", "descent", "landing"

CLASSES = (GROUND, TAKEOFF, HOVER, STRAIGHT, TURN, CLIMB, DESCENT, LANDING)
FLOWN_CLASSES = CLASSES[1:]
"""In the air."""
