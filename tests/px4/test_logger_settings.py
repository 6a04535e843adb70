"""One way to set the logger, wherever it is told."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from fusetune.px4.estimator_samples import is_complete, logged_share
from fusetune.px4.flight import Flight
from fusetune.px4.logger_settings import FROM_BOOT, MODES, PROFILE_FOR_REPLAY, logging_profile_of, logs_from_boot


def test_the_mode_is_that_of_px4s_parameter_reference() -> None:
    """SDLOG_MODE: 0 when armed until disarm, 1 from boot until disarm, 2 from boot until shutdown."""
    assert (FROM_BOOT, MODES[FROM_BOOT], PROFILE_FOR_REPLAY) == (2, "from boot to shutdown", 0b11)
    assert logs_from_boot({"SDLOG_MODE": 2})
    assert not any(logs_from_boot({"SDLOG_MODE": mode}) for mode in (-1, 0, 1, 3, 4, float("nan")))
    assert logging_profile_of({"SDLOG_PROFILE": float("nan")}) == 0


def test_manuals_advise_the_same(project_root: Path) -> None:
    advice = re.compile(r"`?SDLOG_(MODE|PROFILE)`?(?: to| =) (\d+)")
    found = [
        match
        for file in (project_root / "README.md", *sorted((project_root / "docs").glob("*.md")))
        for match in advice.findall(file.read_text(encoding="utf-8"))
    ]
    assert {name for name, _ in found} == {"MODE", "PROFILE"}
    assert {(name, int(value)) for name, value in found} == {("MODE", FROM_BOOT), ("PROFILE", PROFILE_FOR_REPLAY)}


@pytest.mark.parametrize(("kept", "share"), [(slice(None), 1.0), (slice(None, None, 2), 0.5), (slice(0, 0), 0.0)])
def test_share_of_the_samples_that_are_logged(kept: slice, share: float) -> None:
    """100 samples, of which two updates each name the same, cut to 0.1 ms."""
    samples = np.arange(100) * 50_000 + 1_000_049
    updates = np.sort(np.concatenate([samples + 2_000, samples + 12_000]))
    relative = -((updates - np.repeat(samples, 2)) // 100)
    table = {"timestamp": updates, "vehicle_air_data_timestamp_rel": relative.astype(np.int16)}
    topics = {("ekf2_timestamps", 0): table, ("vehicle_air_data", 0): {"timestamp": samples[kept]}}
    found = logged_share(Flight("made", topics), "vehicle_air_data")
    assert found == pytest.approx(share)
    assert is_complete(found) == (share == 1.0)


def test_a_log_that_does_not_tell_is_not_complete() -> None:
    table = {"timestamp": np.arange(5), "vehicle_air_data_timestamp_rel": np.full(5, 0x7FFF, np.int16)}
    for topics in ({}, {("ekf2_timestamps", 0): {"timestamp": np.arange(5)}}, {("ekf2_timestamps", 0): table}):
        assert logged_share(Flight("made", topics), "vehicle_air_data") is None
    assert not is_complete(None)
