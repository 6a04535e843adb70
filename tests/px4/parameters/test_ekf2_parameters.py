"""Metadata, checks and migration of EKF2 parameters."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from pyulog import ULog

from fusetune.px4.flight import ParameterValue
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    PARAMETERS,
    ParameterError,
    as_float32,
    check_value,
    migrate,
)
from fusetune.px4.releases import READ, name_of


def test_number_of_parameters_of_the_baseline() -> None:
    assert len(PARAMETERS) == 140  # EKF2 parameters that PX4 v1.16 lists


def test_every_parameter_of_the_baseline_is_described_and_fits_its_file_format() -> None:
    for name, metadata in PARAMETERS.items():
        assert metadata.description, name
        assert len(name) <= 16
        check_value(name, metadata.default)


def test_shipped_facts_agree_with_the_table_of_facts(shared_data: Path) -> None:
    with (shared_data / "ekf2_params.csv").open(newline="") as stream:
        rows = {row["name"]: row for row in csv.DictReader(stream)}
    assert rows.keys() == ALL_PARAMETERS.keys()
    for name, row in rows.items():
        metadata = ALL_PARAMETERS[name]
        assert (metadata.type, metadata.unit) == (row["type"], row["unit"])
        for release in READ:
            default = row[f"default_{name_of(release)}"]
            assert metadata.exists_in(release) == (default != ""), (name, release)
            if default:
                assert metadata.default_in(release) == as_float32(float(default)), (name, release)


def test_defaults_change_with_the_release() -> None:
    assert PARAMETERS["EKF2_BARO_NOISE"].default_in((1, 10)) == 2.0
    assert PARAMETERS["EKF2_BARO_NOISE"].default_in((1, 11, 3)) == 3.5
    assert PARAMETERS["EKF2_WIND_NSD"].renamed_from == ("EKF2_WIND_NOISE",)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("EKF2_GPS_V_NOISE", 0.5),
        ("EKF2_GPS_V_NOISE", 1),
        ("EKF2_HGT_REF", 2),
        ("EKF2_HGT_REF", 2.0),
        ("EKF2_GPS_CTRL", 15),
        ("EKF2_OF_CTRL", True),
        ("EKF2_ACC_B_NOISE", 0.01),
    ],
)
def test_good_values_pass(name: str, value: object) -> None:
    check_value(name, value)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("EKF2_GPS_VNOISE", 0.5, "unknown EKF2 parameter. Use EKF2_GPS_V_NOISE"),
        ("EKF2_AID_MASK", 1, "no longer has it. Use EKF2_GPS_CTRL"),
        ("EKF2_GPS_V_NOISE", 50.0, "50 is out of range. Give between 0.01 and 5 m/s"),
        ("EKF2_GPS_V_NOISE", "0.5", "'0.5' is not a number"),
        ("EKF2_GPS_V_NOISE", float("nan"), "nan is not a number"),
        ("EKF2_GPS_V_NOISE", True, "True is not a number"),
        ("EKF2_GPS_V_NOISE", None, "None is not a number"),
        ("EKF2_HGT_REF", 1.5, "not a whole number"),
        ("EKF2_HGT_REF", 7, "none of its values. Choose one of 0 (Barometric pressure)"),
        ("EKF2_GPS_CTRL", 16, "bits that do not exist"),
        ("EKF2_GPS_CTRL", -1, "bits that do not exist"),
        ("EKF2_OF_CTRL", 2, "out of range. Give 0 or 1"),
        ("EKF2_GPS_V_GATE", 0.5, "Give at least 1 SD"),
    ],
)
def test_bad_values_are_explained(name: str, value: object, said: str) -> None:
    with pytest.raises(ParameterError) as error:
        check_value(name, value)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({"EKF2_AID_MASK": 1, "EKF2_HGT_MODE": 0}, {"EKF2_GPS_CTRL": 7, "EKF2_OF_CTRL": 0, "EKF2_HGT_REF": 0}),
        ({"EKF2_AID_MASK": 129}, {"EKF2_GPS_CTRL": 15}),
        ({"EKF2_AID_MASK": 24, "EKF2_HGT_MODE": 3}, {"EKF2_GPS_CTRL": 0, "EKF2_EV_CTRL": 11, "EKF2_HGT_REF": 3}),
        ({"EKF2_AID_MASK": 256 + 8}, {"EKF2_EV_CTRL": 7}),
        ({"EKF2_AID_MASK": 2 + 4 + 32}, {"EKF2_OF_CTRL": 1, "EKF2_IMU_CTRL": 5, "EKF2_DRAG_CTRL": 1}),
        ({"EKF2_AID_MASK": 0, "EKF2_HGT_MODE": 1}, {"EKF2_GPS_CTRL": 2, "EKF2_HGT_REF": 1}),
        ({"EKF2_HGT_MODE": 2, "EKF2_RNG_AID": 0}, {"EKF2_HGT_REF": 2, "EKF2_RNG_CTRL": 2}),
        ({"EKF2_WIND_NOISE": 0.1}, {"EKF2_WIND_NSD": as_float32(0.01)}),
        ({"EKF2_REQ_GDOP": 3.0}, {"EKF2_REQ_PDOP": 3.0}),
        ({"EKF2_PCOEF_Y": 0.25}, {"EKF2_PCOEF_YN": 0.25, "EKF2_PCOEF_YP": 0.25}),
        ({"SENS_GPS0_DELAY": 150.0}, {"EKF2_GPS_DELAY": 150.0}),
        ({"EKF2_AID_MASK": 1, "EKF2_GPS_CTRL": 3}, {"EKF2_GPS_CTRL": 3}),
        ({"EKF2_MAG_TYPE": 3}, {"EKF2_MAG_TYPE": 0}),
    ],
)
def test_old_parameters_in_the_meaning_of_the_baseline(old: dict[str, ParameterValue], new: dict[str, float]) -> None:
    migrated = migrate(old)
    assert {name: migrated[name] for name in new} == new
    assert not set(migrated) - set(PARAMETERS)


def test_overrides_win_over_logged_and_logged_over_defaults() -> None:
    values = complete({"EKF2_GPS_V_NOISE": 0.4, "EKF2_MAG_GATE": 4.0}, {"EKF2_GPS_V_NOISE": 0.1}, (1, 13, 0))
    assert values["EKF2_GPS_V_NOISE"] == as_float32(0.1) != 0.1
    assert values["EKF2_MAG_GATE"] == 4.0
    assert values["EKF2_BARO_GATE"] == 5.0
    assert values.keys() == PARAMETERS.keys()
    with pytest.raises(ParameterError, match="unknown"):
        complete({}, {"EKF2_NONSENSE": 1.0}, None)


def test_completed_parameters_equal_those_px4_used(shared_logs: Path, shared_reference: Path) -> None:
    assert compare_parameters(shared_logs, shared_reference) > 100


def test_completed_parameters_equal_those_px4_used_on_the_golden_flights(
    golden_logs: Path, golden_reference: Path
) -> None:
    assert compare_parameters(golden_logs, golden_reference) >= 5


def compare_parameters(logs: Path, reference: Path) -> int:
    """Every log and set replayed by PX4's own EKF2, all 140 values, bit for bit; the number of sets compared.

    EKF2_MAG_DECL alone may differ: the estimator writes the declination of the place back to it during the flight
    (EKF2_DECL_TYPE bit 1), and the reference holds the parameters after the replay.
    """
    files = sorted(reference.glob("*/*.json"))
    logged: dict[str, ULog] = {}
    for file in files:
        name = file.parent.name
        if name not in logged:
            logged[name] = ULog(str(logs / f"{name}.ulg"), message_name_filter_list=[])
        summary = json.loads(file.read_text())
        release = logged[name].get_version_info()
        values = complete(logged[name].initial_parameters, summary["overrides"], release[:3])
        expected = summary["params"]
        if values["EKF2_MAG_DECL"] != expected["EKF2_MAG_DECL"]:
            assert int(values["EKF2_DECL_TYPE"]) & 2
            values["EKF2_MAG_DECL"] = expected["EKF2_MAG_DECL"]
        assert values == expected, (name, file.stem)
    return len(files)


def test_a_limit_that_was_rounded_to_single_precision_is_that_limit() -> None:
    # 0.1 rad/s, the largest EKF2_GYR_NOISE, is 0.10000000149 as a float32
    assert as_float32(0.1) > 0.1
    check_value("EKF2_GYR_NOISE", as_float32(0.1))
    with pytest.raises(ParameterError, match="out of range"):
        check_value("EKF2_GYR_NOISE", 0.1001)
    with pytest.raises(ParameterError, match="out of range"):
        check_value("EKF2_GYR_NOISE", 1e300)
