"""The estimator against PX4 v1.16's own EKF2 on the golden flights, which every clone of the project holds.

Expected: the figures in tests/golden/reference, which PX4's C++ computed. The limits are some 1.3 times what was
measured; a change of most parameters by 1 % is outside of them.
"""

from __future__ import annotations

import json
import lzma
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from benchmarks.reference_flights import GOLDEN
from tests.ekf2.replay.equal_rows import assert_equal_rows
from tests.ekf2.replay.px4_agreement import Limits, assert_replay_agrees, departures
from tests.golden.cut import GOLDEN_FLIGHTS, MADE, cut_all

from fusetune.analyze.replaying.replay_log import replay_log
from fusetune.analyze.trust.fidelity import COMPARED_SOURCES, compare_folders, comparison_start, load_innovations
from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.px4.aid_sources import OLD_SOURCES
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog
from fusetune.storage.documents import read_document
from fusetune.storage.parquet import read_table

LIMITS = {
    "fw_airspeed": Limits(2.2e-4, 6e-6, 2.5e-5, 2e-4, 1.0e-7, flags_equal=1.0),
    "mc_drag": Limits(2.0e-4, 5e-6, 1.0e-5, 3e-4, 1.0e-7, flags_equal=1.0),
    "mc_flow": Limits(2.2e-4, 3e-5, 1.0e-5, 3e-4, 1.2e-7, flags_equal=1.0),
    "mc_gnss_yaw": Limits(1.0e-4, 3e-6, 2.0e-6, 5e-5, 1.0e-7, flags_equal=1.0),
    "mc_vision": Limits(6.5e-4, 5e-6, 5.0e-6, 1e-4, 1.0e-7, flags_equal=1.0),
}
"""In the order of the fields: innovation, variance, velocity (m/s), attitude (deg), gyro bias (rad/s)."""

DATA = (".xz", ".parquet", ".json")

NOT_PUBLISHED = {"ev_vel"}
"""Fused in mc_vision; the reference holds no innovation of it, so it shows in the states alone."""

NOT_FLOWN = {"aux_vel", *OLD_SOURCES}
"""No golden flight has a landing target, and v1.16 has not the sources of older releases."""

NAMES = [flight.name for flight in GOLDEN_FLIGHTS]


@pytest.mark.parametrize("name", NAMES)
def test_replay_is_that_of_px4(golden_logs, golden_reference, tmp_path, name):
    assert_replay_agrees(golden_logs / f"{name}.ulg", golden_reference / name, tmp_path, LIMITS[name])


SLIGHTLY_OTHER = (
    (
        "fw_airspeed",
        1.01,
        ("GPS_V_NOISE", "BARO_NOISE", "MAG_NOISE", "EAS_NOISE", "BETA_NOISE", "GYR_NOISE", "ACC_NOISE"),
    ),
    ("fw_airspeed", 1.02, ("WIND_NSD",)),
    ("fw_airspeed", 1.1, ("ACC_B_NOISE",)),
    ("fw_airspeed", 1.25, ("GPS_P_NOISE",)),
    ("mc_drag", 1.01, ("DRAG_NOISE", "MCOEF", "BCOEF_Y", "GRAV_NOISE")),
    ("mc_flow", 1.01, ("OF_N_MIN", "OF_N_MAX", "RNG_NOISE", "RNG_SFE", "TERR_NOISE")),
    ("mc_flow", 1.02, ("OF_GATE",)),
    ("mc_gnss_yaw", 1.01, ("GPS_DELAY", "GYR_B_NOISE")),
    ("mc_vision", 1.01, ("EVP_NOISE", "EVV_NOISE", "EVA_NOISE", "EV_DELAY")),
)
"""Flight, factor, parameters. EKF2_GPS_P_NOISE acts above the receiver's accuracy (0.6 m) only."""


@pytest.mark.parametrize(
    ("flight", "parameter", "factor"),
    [(flight, f"EKF2_{name}", factor) for flight, factor, names in SLIGHTLY_OTHER for name in names],
)
def test_a_filter_that_is_slightly_other_is_seen(golden_logs, golden_reference, tmp_path, flight, parameter, factor):
    """A parameter that is off stands for a wrong line of the estimator that reads it."""
    reference = golden_reference / flight
    (summary,) = reference.glob("*.json")
    content = read_document(summary)
    params = content["params"] | {parameter: factor * content["params"][parameter]}
    sets, replays = tmp_path / "sets", tmp_path / "replays"
    sets.mkdir()
    (sets / summary.name).write_text(json.dumps({"params": params}))
    replay_log(golden_logs / f"{flight}.ulg", sets, replays)
    (found,) = compare_folders(reference, replays)
    assert departures(found, LIMITS[flight])


def test_every_compared_source_is_fused_in_flight(golden_reference):
    """PX4's own rows: each source but two is fused some dozens of times after take-off, and some samples are not."""
    fused, decisions = Counter(), Counter()
    for file in golden_reference.glob("*/*.innovations.parquet"):
        rows = load_innovations(file)
        flags = read_table(str(file).replace("innovations", "status_flags"), ["timestamp", "cs_in_air"])
        take_off = flags["timestamp"].to_numpy()[np.argmax(flags["cs_in_air"].to_numpy())]
        flown = rows.rows((rows.timestamp > take_off) & (rows.axis == 0))
        fused.update(flown.source[flown.fused].tolist())
        compared = rows.rows((rows.timestamp >= comparison_start(rows)) & np.isin(rows.source, COMPARED_SOURCES))
        decisions.update(zip(compared.fused.tolist(), compared.rejected.tolist(), strict=True))
    assert {source for source in COMPARED_SOURCES if fused[source] < 25} == NOT_PUBLISHED | NOT_FLOWN
    assert min(decisions[True, False], decisions[False, True], decisions[False, False]) > 25


def test_golden_is_small():
    assert sum(file.stat().st_size for file in GOLDEN.rglob("*.*") if file.suffix in DATA) <= 1_500_000


def test_golden_is_what_is_cut_from_the_made_flights(shared_logs, shared_reference, tmp_path):
    """Parquet and xz may pack the same content into other bytes in other versions, so it is unpacked first."""
    cut_all(shared_logs, shared_reference, tmp_path)
    files = {file.relative_to(GOLDEN) for file in GOLDEN.rglob("*.*") if file.suffix in DATA}
    assert {file.relative_to(tmp_path) for file in tmp_path.rglob("*.*")} == files
    for file in files:
        assert _same_content(tmp_path / file, GOLDEN / file), file


def _same_content(one: Path, other: Path) -> bool:
    if one.suffix == ".parquet":
        return read_table(one).to_pandas().equals(read_table(other).to_pandas())
    unpacked = lzma.decompress if one.suffix == ".xz" else bytes
    return unpacked(one.read_bytes()) == unpacked(other.read_bytes())


@pytest.mark.parametrize("name", NAMES)
def test_cut_log_gives_the_estimator_the_same_samples(shared_logs, golden_logs, name):
    """Only what the replay reads was kept of the log, and it is all that it reads."""
    logs = shared_logs / f"{MADE}{name}.ulg", golden_logs / f"{name}.ulg"
    whole, cut = (build_inputs(canonical(read_ulog(log))).arrays for log in logs)
    assert len(cut.imu) > 6000
    for field, samples in cut._asdict().items():
        assert_equal_rows(samples, getattr(whole, field)[: len(samples)])
