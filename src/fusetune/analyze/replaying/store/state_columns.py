"""Where each part of the state stands in the table of a replay's states: columns of values and of variances."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.ekf2.filter.common.state import ERROR_STATE_BLOCKS, PUBLISHED_STATE_BLOCKS


def _columns(prefix: str, blocks: Mapping[str, tuple[int, int]]) -> dict[str, tuple[str, ...]]:
    return {
        name: tuple(f"{prefix}_{number}" for number in range(first, first + size))
        for name, (first, size) in blocks.items()
    }


STATE_COLUMNS: Mapping[str, tuple[str, ...]] = _columns("states", PUBLISHED_STATE_BLOCKS)
"""Part of the state → its columns: `quaternion` (w, x, y, z), `velocity`, … `terrain`."""

VARIANCE_COLUMNS: Mapping[str, tuple[str, ...]] = _columns("covariances", ERROR_STATE_BLOCKS)
"""Part of the error state → columns of its variances: `attitude` (rotation in NED), `velocity`, … `terrain`."""
