"""Studies that fill a space between bounds: bounds, grids and constraints kept, stable under extension."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fusetune.design.study import Study, load_study
from fusetune.design.tunable_parameters import TUNABLE_PARAMETERS
from fusetune.errors import UserError

DRIFT_BELOW_NOISE = "EKF2_GYR_B_NOISE < EKF2_GYR_NOISE"


def study(folder: Path, **keys: object) -> Study:
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump({"name": "s", **keys}, sort_keys=False), encoding="utf-8")
    return load_study(path)


def message_of(folder: Path, **keys: object) -> str:
    with pytest.raises(UserError) as error:
        study(folder, **keys)
    return str(error.value)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.sampled_from(["latin_hypercube", "sobol"]),
    names=st.lists(st.sampled_from(list(TUNABLE_PARAMETERS)), min_size=1, max_size=6, unique=True),
    number=st.integers(1, 40),
    more=st.integers(0, 30),
    seed=st.integers(0, 50),
)
def test_bounds_are_kept_and_more_sets_leave_the_first(
    tmp_path: Path, kind: str, names: list[str], number: int, more: int, seed: int
) -> None:
    keys = {"kind": kind, "seed": seed, "factors": {name: {} for name in names}}
    sets = study(tmp_path, number=number, **keys).sets
    assert len(sets) == number
    for one in sets:
        assert list(one.overrides) == names
        for name, value in one.overrides.items():
            low, high = TUNABLE_PARAMETERS[name].sane_range({})
            assert low <= value <= high
            grid = TUNABLE_PARAMETERS[name].facts.grid
            assert not grid or value % grid == 0.0
    assert study(tmp_path, number=number + more, **keys).sets[:number] == sets


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(kind=st.sampled_from(["latin_hypercube", "sobol"]), number=st.integers(1, 40), seed=st.integers(0, 50))
def test_sets_that_break_a_constraint_are_passed_over(tmp_path: Path, kind: str, number: int, seed: int) -> None:
    factors = {"EKF2_GYR_NOISE": {"low": 0.001, "high": 0.01}, "EKF2_GYR_B_NOISE": {"low": 0.0005, "high": 0.01}}
    keys = {"kind": kind, "seed": seed, "factors": factors}
    free = study(tmp_path, number=2 * number + 20, **keys).sets
    held = study(tmp_path, number=number, constraints=[DRIFT_BELOW_NOISE], **keys).sets
    values = [one.overrides for one in held]
    assert all(one["EKF2_GYR_B_NOISE"] < one["EKF2_GYR_NOISE"] for one in values)
    kept = [one.overrides for one in free if one.overrides["EKF2_GYR_B_NOISE"] < one.overrides["EKF2_GYR_NOISE"]]
    assert values[: len(kept)] == kept[:number]
    assert len(held) == number
    more = study(tmp_path, number=number + 9, constraints=[DRIFT_BELOW_NOISE], **keys).sets
    assert more[:number] == held


def test_a_grid_leaves_out_what_breaks_a_constraint(tmp_path: Path) -> None:
    vary = {"EKF2_GYR_NOISE": [0.001, 0.01], "EKF2_GYR_B_NOISE": [0.001, 0.005]}
    found = study(tmp_path, kind="grid", vary=vary, constraints=[DRIFT_BELOW_NOISE]).sets
    assert [tuple(one.overrides.values()) for one in found] == [(0.01, 0.001), (0.01, 0.005)]
    equal = study(tmp_path, kind="grid", vary=vary, constraints=["EKF2_GYR_B_NOISE <= EKF2_GYR_NOISE"]).sets
    assert len(equal) == 3


def test_half_of_a_logarithmic_scale_lies_below_the_geometric_mean(tmp_path: Path) -> None:
    """As many of 64 points of a Latin hypercube in each half: by hand, √(0.01 · 1) = 0.1."""
    factor = {"EKF2_ACC_NOISE": {"low": 0.01, "high": 1.0}}
    logarithmic = study(tmp_path, kind="latin_hypercube", number=64, factors=factor)
    factor["EKF2_ACC_NOISE"]["scale"] = None  # left empty, as the catalogue says
    assert study(tmp_path, kind="latin_hypercube", number=64, factors=factor) == logarithmic
    factor["EKF2_ACC_NOISE"]["scale"] = "linear"
    linear = study(tmp_path, kind="latin_hypercube", number=64, factors=factor)
    assert sum(one.overrides["EKF2_ACC_NOISE"] < 0.1 for one in logarithmic.sets) == 32
    assert sum(one.overrides["EKF2_ACC_NOISE"] < 0.505 for one in linear.sets) == 32


@pytest.mark.parametrize(
    ("factors", "said"),
    [
        ({"EKF2_ACC_NOISEE": {}}, "EKF2_ACC_NOISE"),
        ({"EKF2_GPS_CTRL": {}}, "whole number"),
        ({"EKF2_ABL_LIM": {}}, "expected low and high"),
        ({"EKF2_ACC_NOISE": {"low": 0.5, "high": 0.2}}, "low below high"),
        ({"EKF2_ACC_NOISE": {"high": 2.0}}, "out of range"),
        ({"EKF2_GPS_POS_X": {"scale": "log"}}, "above 0 on a logarithmic scale"),
        ({"EKF2_GPS_DELAY": {"low": 101, "high": 104}}, "no step of 10"),
    ],
)
def test_factors_that_cannot_be_are_told(tmp_path: Path, factors: dict, said: str) -> None:
    assert said in message_of(tmp_path, kind="sobol", number=4, factors=factors)


def test_constraints_that_cannot_be_kept_or_known_are_told(tmp_path: Path) -> None:
    keys = {"kind": "latin_hypercube", "number": 4, "factors": {"EKF2_ACC_NOISE": {}, "EKF2_GYR_NOISE": {"high": 0.01}}}
    assert "only 0 sets of 4" in message_of(tmp_path, constraints=["EKF2_ACC_NOISE < EKF2_GYR_NOISE"], **keys)
    said = message_of(tmp_path, constraints=["EKF2_ACC_B_NOISE < EKF2_ACC_NOISE"], **keys)
    assert "EKF2_ACC_B_NOISE is neither varied nor fixed" in said


def test_the_shipped_example_keeps_its_constraint(project_root: Path) -> None:
    sets = load_study(project_root / "config/studies/process_noise_sobol.yaml").sets
    assert len(sets) == 32
    assert all(one.overrides["EKF2_GYR_B_NOISE"] < one.overrides["EKF2_GYR_NOISE"] for one in sets)
