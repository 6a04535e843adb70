"""Whether anything tells the heading, which a fusion may change only then (since main of May 2026)."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.releases.by_release import by_release

HEADING_MEMORY = np.dtype([("observable", "?")], align=True)
"""Sub-record `ekf.heading`."""


@kernel
def _update_nothing(ekf):
    """Before, the heading is always corrected."""


@kernel
def _find_heading_observability(ekf):
    cs = ekf.cs
    by_yaw = cs.mag_hdg or cs.mag_3d or cs.ev_yaw or cs.gnss_yaw
    ekf.heading.observable = by_yaw or is_north_east_aiding_active(ekf)


update_heading_observability = by_release(_update_nothing, "holds_unobservable_heading", _find_heading_observability)


@kernel
def _is_always_corrected(ekf):
    return False


@kernel
def _is_unobservable(ekf):
    return not ekf.heading.observable


is_heading_held = by_release(_is_always_corrected, "holds_unobservable_heading", _is_unobservable)
"""Whether fusions leave the heading alone."""
