"""What a saved flight exercises, and the sets around the present values that follow from the flights of a vehicle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.save.made_flight import made_flight
from tests.save.test_present import OCTOROTOR, row

from fusetune.design.tunable_parameters import USUALLY_VARIED
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.save import find_present, read_present, write_present
from fusetune.save.exercise import exercise_of
from fusetune.save.flight_folder import write_flight
from fusetune.save.verdict import judge

DEFAULTS = {name: one.default for name, one in PARAMETERS.items()}


def saved(folder: Path, *, yaw_rate: float = 0.0, **parameters: float) -> Path:
    """A made flight as `save_log` leaves it; it turns about its vertical axis for a tenth of the time."""
    flight = made_flight()
    rates = flight.topics["sensor_combined", 0]["gyro_rad[2]"]
    rates[: len(rates) // 10] += np.float32(yaw_rate)
    folder.mkdir()
    extra = {"verdict": judge(flight).document(), "ekf2_parameters": DEFAULTS | parameters}
    write_flight(folder, flight, extra)
    return folder


def test_topics_accuracies_and_rates_are_those_of_the_log(tmp_path: Path) -> None:
    found = exercise_of(saved(tmp_path / "a", yaw_rate=1.0))
    assert {"vehicle_gps_position", "vehicle_magnetometer"} <= found.topics
    assert "vehicle_visual_odometry" not in found.topics
    assert found.reported == pytest.approx({"eph": 0.4, "epv": 0.4, "s_variance_m_s": 0.4})
    # yaw moves the ends of arms along x and y, not along z; the gyro's noise is 0.01 rad/s
    assert found.turning == pytest.approx((1.0, 1.0, 0.0), abs=0.06)


@pytest.fixture
def flights(tmp_path: Path) -> dict[str, Path]:
    return {"a": saved(tmp_path / "a"), "b": saved(tmp_path / "b", EKF2_MAG_NOISE=0.03)}


def test_sets_around_the_newest_flight_give_what_the_logs_differ_in(flights: dict[str, Path], tmp_path: Path) -> None:
    rows = [row("a", "2026-05-01"), row("b", "2026-05-02")]
    present = find_present(rows, flights, USUALLY_VARIED, "b", around=USUALLY_VARIED)
    sets = {one.name: one.overrides for one in present.sets}
    assert sets["acc_noise_up"] == {"EKF2_MAG_NOISE": 0.03, "EKF2_ACC_NOISE": 0.7}
    assert sets["mag_noise_up"] == {"EKF2_MAG_NOISE": 0.06}
    # the receiver reports 0.4, above the floor of 0.3
    assert present.left_out["gps_v_noise_down"] == "the receiver reports 0.4 or more, above the floor"
    assert "gps_v_noise_up" in sets
    assert not [name for name in sets if name.startswith("gps_pos")]
    write_present(tmp_path / "present.json", present)
    assert read_present(tmp_path / "present.json") == present


def test_flights_with_the_same_values_keep_their_own(flights: dict[str, Path]) -> None:
    present = find_present([row("a", "2026-05-01")], flights, USUALLY_VARIED, None, around=USUALLY_VARIED)
    assert all(len(one.overrides) == 1 for one in present.sets)


def test_another_vehicles_flights_say_nothing(flights: dict[str, Path]) -> None:
    other = row("b", "2026-05-01", vehicle=OCTOROTOR)
    present = find_present([row("a", "2026-05-02"), other], flights, USUALLY_VARIED, "a", around=USUALLY_VARIED)
    assert all("EKF2_MAG_NOISE" not in one.overrides for one in present.sets if not one.name.startswith("mag_noise"))


def test_a_study_with_sets_of_its_own_has_none_around(flights: dict[str, Path]) -> None:
    assert find_present([row("a", "2026-05-01")], flights, ["EKF2_ACC_NOISE"], None).sets == ()
