"""Where releases until v1.15 keep the horizontal position: in metres of the local frame.

Height is in `ekf.gpos_alt` in all releases. In these it counts from the origin, where v1.16's counts from sea level;
so the local down position is its negative. Before an origin is known, the frame begins where the filter started.
"""

import numpy as np

from fusetune.ekf2.feed.record_fields import fields

LOCAL_POSITION = np.dtype(fields("f8", "north", "east", "last_known_north", "last_known_east"), align=True)
"""Sub-record `ekf.local` (m): the position estimate, and the last one that was aided."""

POSITION_LIMIT = 1e6
"""Metres beyond which a local position does not go."""
