"""What the filter of the terrain remembers between updates; the height itself is `ekf.terrain`."""

import numpy as np

from fusetune.ekf2.feed.record_fields import fields

TERRAIN_FILTER = np.dtype(
    [
        ("variance", "f8"),
        ("time_last_healthy_range", "i8"),
        *fields("?", "uses_range", "uses_flow", "range_is_faulty", "flow_is_good"),
    ],
    align=True,
)
"""Sub-record `ekf.terrain_filter`: variance (m²) of the terrain, what corrects it now, whether the range finder was
found faulty, and whether a sample of flow is at hand that is good enough."""
