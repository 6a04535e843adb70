"""A flight as several releases see it, on hand-made replays and on one of the baseline."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fusetune.analyze.releases.compared_releases import compare_releases, release_replay
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.replaying.settings import WITHOUT_GAPS
from fusetune.analyze.trust.onboard_fidelity import warm_from
from fusetune.errors import UserError
from fusetune.px4.flight import Flight

SECOND = 1_000_000
FLIGHT = ((10 * SECOND, 20 * SECOND),)


def record(innovation: float, *, later_us: int = 0, rejected: bool = False, on_until: int = 20) -> ReplayedSet:
    """Samples of GNSS velocity at 10 Hz over 30 s, whose innovations alternate; a flag that goes off."""
    time = np.arange(0, 30 * SECOND, SECOND // 10) + later_us
    wave = innovation * np.where(np.arange(time.size) % 2, 1.0, -1.0)
    flags, known = np.full(time.size, rejected), np.ones(time.size)
    samples = {("gnss_vel", 0): AxisSamples(time, known, wave, known, known, flags, ~flags)}
    told: dict[str, Any] = {"timestamp": np.array([0, on_until * SECOND]), "cs_gnss_vel": np.array([True, False])}
    return ReplayedSet("r", {}, {}, {"status": "ok"}, samples, told, {})


def test_size_difference_and_rejections_are_of_the_same_samples() -> None:
    """Innovations of 3 against 2, taken 4 ms later: half as large again, and the difference is 1 of 2."""
    found = release_replay("v1.17", record(3.0, later_us=4_000, rejected=True), record(2.0), {}, FLIGHT)
    axis = found.axis("gnss_vel", 0)
    assert axis is not None
    assert (axis.samples, axis.rms, axis.rejected, axis.fused) == (100, 3.0, 1.0, 0.0)
    assert (axis.rms_change, axis.difference) == pytest.approx((0.5, 0.5))
    assert found.rejected == 100
    # samples 10 ms apart are others
    far = release_replay("v1.17", record(3.0, later_us=10_000), record(2.0), {}, FLIGHT).axis("gnss_vel", 0)
    assert far is not None
    assert far.difference is None
    itself = release_replay("v1.16", record(2.0), None, {}, FLIGHT).axis("gnss_vel", 0)
    assert itself is not None
    assert (itself.rms_change, itself.difference) == (None, None)


def test_flags_are_compared_over_the_time_in_the_air_and_a_loss_is_an_event() -> None:
    """On for 5 of the 10 s, and so as in the other for half of the time."""
    found = release_replay("v1.17", record(1.0, on_until=15), record(1.0), {}, FLIGHT)
    (flag,) = found.flags
    assert (flag.flag, flag.set, flag.equal) == (
        "cs_gnss_vel",
        pytest.approx(0.5, abs=0.01),
        pytest.approx(0.5, abs=0.01),
    )
    assert found.events.total_timeouts == 1


def test_the_release_that_flew_is_what_its_replay_is(survey_flight: Flight) -> None:
    prepared = prepare_flight(survey_flight, WITHOUT_GAPS)
    found = compare_releases(prepared, ["v1.16"])
    assert (found.flown, found.base, [one.release for one in found.replays]) == ("v1.16", "v1.16", ["v1.16"])
    samples = replay_set(prepared, "again", {}).samples
    one = samples["gnss_vel", 0]
    (airborne,) = [(t[0], t[1]) for t in prepared_intervals(survey_flight)]
    counted = (one.timestamp_sample >= max(airborne[0], warm_from(samples))) & (one.timestamp_sample < airborne[1])
    axis = found.replays[0].axis("gnss_vel", 0)
    assert axis is not None
    assert axis.samples == counted.sum()
    assert axis.rms == pytest.approx(np.sqrt(np.mean(one.innovation[counted] ** 2)))
    with pytest.raises(UserError, match=r"v1\.9"):
        compare_releases(prepared, ["v1.9"])


def prepared_intervals(flight: Flight) -> list[tuple[int, int]]:
    from fusetune.analyze.flight.phases import airborne_intervals

    return list(airborne_intervals(flight, {}))
