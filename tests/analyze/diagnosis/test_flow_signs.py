"""Optical flow: its direction is told by turning, not by the way of a filter that follows the flow."""

from pathlib import Path

import numpy as np
import pytest

from fusetune.analyze.diagnosis.diagnosed_logs import AS_FLOWN
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.ulog.reader import read_ulog

TURN_DEG = 20.0


def test_flow_that_is_turned_is_told_by_as_much(shared_logs: Path) -> None:
    log = read_ulog(shared_logs / "synthetic__mc_flow.ulg")
    key = ("vehicle_optical_flow", 0)
    table = dict(log.topics[key])
    seen = (table["pixel_flow[0]"] + 1j * table["pixel_flow[1]"]) * np.exp(1j * np.radians(TURN_DEG))
    table |= {"pixel_flow[0]": seen.real.astype(np.float32), "pixel_flow[1]": seen.imag.astype(np.float32)}
    one = Signs(ObservedFlight(log.with_topics(log.topics | {key: table}), AS_FLOWN)).flow
    assert one is not None
    assert np.degrees(one.turn) == pytest.approx(TURN_DEG, abs=2.0)
    # the filter follows the flow: its way makes a good half of it
    along, across = one.fit.values[:2]
    assert np.degrees(np.arctan2(across, along)) < 0.75 * TURN_DEG
