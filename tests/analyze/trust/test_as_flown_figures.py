"""Figures of a replay against the vehicle on made tracks; expected values by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.trust.as_flown_figures import as_flown_figures
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import FLAG_COLUMNS, FLAGS_ROW, INNOVATION_ROW, LOCAL_POSITION_ROW, STATE_ROW
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.flight import Flight, TopicTable

SECONDS = 60
TIME = np.arange(0, SECONDS * 1_000_000, 100_000, dtype=np.int64)
FLIGHT = ((0, SECONDS * 1_000_000),)
V1_12, V1_16 = 0x010C0000 | 255, 0x01100000 | 255


def replayed(**columns: np.ndarray) -> Any:
    local = np.zeros(len(TIME), LOCAL_POSITION_ROW)
    local["timestamp"] = local["timestamp_sample"] = TIME
    for name, values in columns.items():
        local[name] = values
    flags = np.zeros(1, FLAGS_ROW)
    return SimpleNamespace(
        local_position=local, flags=flags, innovations=np.zeros(0, INNOVATION_ROW), states=np.zeros(0, STATE_ROW)
    )


def logged(**columns: np.ndarray) -> TopicTable:
    names = ("x", "y", "z", "vx", "vy", "vz", "heading")
    table: TopicTable = {"timestamp": TIME, **{name: np.zeros(len(TIME), np.float32) for name in names}}
    table |= {name: np.ones(len(TIME), np.bool_) for name in ("xy_valid", "v_xy_valid", "z_valid", "v_z_valid")}
    table |= {name: np.zeros(len(TIME), np.uint8) for name in ("z_reset_counter", "vz_reset_counter")}
    return table | columns


def figures(result: Any, local: TopicTable, release: int = V1_12, onboard: Any = None, **topics: TopicTable) -> Any:
    tables = {("vehicle_local_position", 0): local, **{(name, 0): table for name, table in topics.items()}}
    flight = Flight("made", tables, info={"ver_sw_release": release}, last_timestamp=int(TIME[-1]))
    measured = np.ones(len(result.innovations), np.bool_)
    return as_flown_figures(cast(ReplayResult, result), measured, flight, FLIGHT, onboard or {})


def test_height_is_compared_less_its_mean_and_vertical_velocity_as_it_is() -> None:
    wave = np.where(np.arange(len(TIME)) % 2 == 0, 1.0, -1.0)
    found = figures(replayed(z=5.0 + 0.4 * wave, vz=np.full(len(TIME), 0.3)), logged())
    assert found.height_m == pytest.approx(0.4, rel=1e-6)
    assert found.vertical_velocity_m_s == pytest.approx(0.3, rel=1e-6)
    assert (found.velocity_m_s, found.heading_deg) == (0.0, 0.0)


def test_a_vehicle_without_valid_velocity_is_still_compared_in_height_and_heading() -> None:
    never = np.zeros(len(TIME), np.bool_)
    aligned: TopicTable = {"timestamp": TIME, "cs_yaw_align": np.ones(len(TIME), np.bool_)}
    turned = replayed(heading=np.full(len(TIME), np.radians(2.0)))
    found = figures(turned, logged(xy_valid=never, v_xy_valid=never), estimator_status_flags=aligned)
    assert found.velocity_m_s is None
    assert found.heading_deg == pytest.approx(2.0, rel=1e-5)
    assert (found.height_m, found.vertical_velocity_m_s) == (0.0, 0.0)


def test_without_valid_height_there_is_no_figure_of_it() -> None:
    never = np.zeros(len(TIME), np.bool_)
    found = figures(replayed(), logged(z_valid=never, v_z_valid=never))
    assert (found.height_m, found.vertical_velocity_m_s) == (None, None)
    assert figures(replayed(), {"timestamp": TIME}).height_resets is None


def test_resets_are_counted_on_both_sides_and_the_logged_counter_wraps() -> None:
    # ours: 144 more, one every 0.4 s; the vehicle's: 254, 255, 0, 1 at 10, 20, 30 s, which is three
    ours = np.minimum(np.arange(len(TIME)) // 4, 144)
    theirs = (254 + np.clip(np.arange(len(TIME)) // 100, 0, 3)).astype(np.uint8)
    found = figures(replayed(z_reset_counter=ours), logged(z_reset_counter=theirs))
    assert found.resets == {"height": (144, 3), "vertical velocity": (0, 0)}
    assert found.height_resets == 141


def test_resets_that_the_selector_makes_are_not_asked_of_the_replay() -> None:
    selector: TopicTable = {
        "timestamp": np.array([0, 20_000_000], np.int64), "primary_instance": np.array([0, 1], np.uint8)
    }  # fmt: skip
    at_switch, later = (np.array(at <= TIME, np.uint8) for at in (20_100_000, 40_000_000))
    found = figures(replayed(), logged(z_reset_counter=at_switch + later), estimator_selector_status=selector)
    assert found.resets["height"] == (0, 1)


def with_flags(result: Any, *names: str) -> Any:
    for name in names:
        result.flags["flags"][:, FLAG_COLUMNS.index(name)] = 1
    return result


def test_the_sources_of_height_count_as_far_as_the_release_has_them() -> None:
    """Before v1.14 one source excludes the others, so that the replay may use more beside it."""
    part = np.array(TIME < 0.46 * SECONDS * 1e6)
    whole = np.ones(len(TIME), np.bool_)
    both: TopicTable = {"timestamp": TIME, "cs_baro_hgt": whole, "cs_gps_hgt": ~whole}
    ours = with_flags(replayed(), "cs_baro_hgt", "cs_gps_hgt")
    assert figures(ours, logged(), V1_12, estimator_status_flags=both).height_flags_equal == 1.0
    assert figures(ours, logged(), V1_16, estimator_status_flags=both).height_flags_equal == 0.0
    sometimes = both | {"cs_baro_hgt": ~part}
    only_gnss = with_flags(replayed(), "cs_gps_hgt")
    share = figures(only_gnss, logged(), V1_12, estimator_status_flags=sometimes).height_flags_equal
    assert share == pytest.approx(0.46, abs=0.002)
    nothing = both | {"cs_baro_hgt": ~whole}
    assert figures(ours, logged(), estimator_status_flags=nothing).height_flags_equal is None


def vision_yaw(size: float, every: int) -> AxisSamples:
    time = TIME[::every]
    unknown, flags = np.full(len(time), np.nan), np.ones(len(time), np.bool_)
    innovation = size * np.where(np.arange(len(time)) % 2 == 0, 1.0, -1.0)
    return AxisSamples(time, unknown, innovation, np.full(len(time), 0.01), unknown, ~flags, flags)


def test_heading_innovations_of_vision_are_set_beside_those_of_vision() -> None:
    """0.0153 rad of the replay to 0.0096 rad of the vehicle; what the replay made before is not compared."""
    result = replayed()
    rows = np.zeros(len(TIME), INNOVATION_ROW)
    rows["source"], rows["timestamp_sample"] = AID_SOURCE_NAMES.index("ev_yaw"), TIME
    rows["innovation"] = np.where(TIME < 30_000_000, 9.0, 0.0153)
    rows["innovation_variance"], rows["fused"] = 0.01, True
    result.innovations = rows
    flown = vision_yaw(0.0096, 5)
    late = AxisSamples(*(getattr(flown, name)[70:] for name in flown.__dataclass_fields__))
    found = figures(result, logged(), onboard={("ev_yaw", 0): late})
    assert found.innovation_ratio == {"vision_heading": pytest.approx(0.0153 / 0.0096, rel=1e-3)}
