"""Other releases than v1.16 against what their own estimators computed on synthetic logs, where those are at hand."""

from __future__ import annotations

import pytest
from benchmarks.release_fidelity import beyond, compared

from fusetune.ekf2.releases.behaviours import BASELINE, MODELLED

FLIGHTS = ("synthetic__fw_airspeed", "synthetic__mc_gnss_yaw", "synthetic__mc_range", "synthetic__mc_vision")
"""Short, and together they fuse every source but gravity and drag."""


@pytest.mark.parametrize("flight", FLIGHTS)
@pytest.mark.parametrize("release", [one for one in MODELLED if one != BASELINE])
def test_replays_are_those_of_the_release(shared_reference_releases, shared_logs, release, flight):
    ((_, results),) = compared(release, shared_reference_releases / release, shared_logs, [flight])
    assert not isinstance(results, Exception), results
    assert {one.set: beyond(release, one) for one in results} == {one.set: [] for one in results}
    assert len(results) == 3
