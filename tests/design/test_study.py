"""Parameter studies: what they expand to, and what is said about broken ones."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.design.study import load_study
from fusetune.errors import UserError

PAPER_TABLE_11 = {
    "EKF2_ACC_B_NOISE": (0.003, 0.001, 0.003, 0.007, 0.01, 0.003),
    "EKF2_GYR_B_NOISE": (0.001, 0.001, 0.003, 0.007, 0.01, 0.001),
    "EKF2_ACC_NOISE": (0.35, 0.1, 0.3, 0.7, 1.0, 0.35),
    "EKF2_GYR_NOISE": (0.015, 0.01, 0.03, 0.07, 0.1, 0.015),
}
"""García, Molina and Trincado, table 11."""


def write(folder: Path, text: str) -> Path:
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def message_of(folder: Path, text: str) -> str:
    path = write(folder, text)
    with pytest.raises(UserError) as error:
        load_study(path)
    assert str(path) in str(error.value)
    return str(error.value)


def test_paper_study_holds_table_11_and_its_fixed_values(project_root: Path) -> None:
    study = load_study(project_root / "config/studies/paper_table11.yaml")
    assert [one.name for one in study.sets] == [f"paper{number}" for number in range(1, 7)]
    for index, one in enumerate(study.sets):
        for name, values in PAPER_TABLE_11.items():
            assert one.overrides[name] == values[index]
        assert one.overrides["EKF2_BARO_NOISE"] == 2.0
        assert one.overrides["EKF2_GPS_V_NOISE"] == one.overrides["EKF2_GPS_P_NOISE"] == 0.5
        assert one.overrides["EKF2_GPS_V_GATE"] == one.overrides["EKF2_BARO_GATE"] == 5.0
    assert study.sets[0].overrides == study.sets[5].overrides


@pytest.mark.parametrize("name", ["noise_one_at_a_time", "imu_noise_grid"])
def test_shipped_examples_load(project_root: Path, name: str) -> None:
    assert load_study(project_root / f"config/studies/{name}.yaml").name == name


def test_one_at_a_time_makes_a_set_per_value_with_the_fixed_ones(tmp_path: Path) -> None:
    study = load_study(
        write(
            tmp_path,
            "name: s\nkind: one_at_a_time\nfixed: {EKF2_BARO_NOISE: 2}\n"
            "vary:\n  EKF2_ACC_NOISE: [0.1, 7e-1]\n  EKF2_GPS_DELAY: [120]\n",
        )
    )
    assert [(one.name, one.overrides) for one in study.sets] == [
        ("acc_noise_0p1", {"EKF2_BARO_NOISE": 2.0, "EKF2_ACC_NOISE": 0.1}),
        ("acc_noise_0p7", {"EKF2_BARO_NOISE": 2.0, "EKF2_ACC_NOISE": 0.7}),
        ("gps_delay_120", {"EKF2_BARO_NOISE": 2.0, "EKF2_GPS_DELAY": 120.0}),
    ]


def test_whole_number_parameters_become_int(tmp_path: Path) -> None:
    text = "name: s\nkind: list\nsets:\n  - {name: a, parameters: {EKF2_GPS_CTRL: 7.0, EKF2_ACC_NOISE: 1}}\n"
    overrides = load_study(write(tmp_path, text)).sets[0].overrides
    assert type(overrides["EKF2_GPS_CTRL"]) is int
    assert type(overrides["EKF2_ACC_NOISE"]) is float


def grid_text(lengths: tuple[int, int, int]) -> str:
    names = ("EKF2_ACC_NOISE", "EKF2_GYR_NOISE", "EKF2_BARO_NOISE")
    values = ((0.35, 0.1, 0.7, 0.2, 0.5), (0.015, 0.01, 0.03, 0.07, 0.1), (1.0, 2.0, 3.0, 4.0, 5.0))
    axes = "".join(
        f"  {name}: {list(axis[:length])}\n" for name, axis, length in zip(names, values, lengths, strict=True)
    )
    return f"name: s\nkind: grid\nvary:\n{axes}"


lengths = st.tuples(*(st.integers(1, 4),) * 3)


@given(lengths, st.integers(0, 2))
def test_growing_grid_keeps_its_sets(
    tmp_path_factory: pytest.TempPathFactory, before: tuple[int, int, int], axis: int
) -> None:
    folder = tmp_path_factory.mktemp("grid")
    small = load_study(write(folder, grid_text(before)))
    grown = list(before)
    grown[axis] += 1
    large = load_study(write(folder, grid_text((grown[0], grown[1], grown[2]))))
    assert len(small.sets) == before[0] * before[1] * before[2]
    assert len({one.name for one in large.sets}) == len(large.sets)
    kept = [one for one in large.sets if one in small.sets]
    assert kept == list(small.sets)
    if before[axis] >= max(before):
        assert large.sets[: len(small.sets)] == small.sets


HEAD = "name: s\nkind: list\nsets:\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (HEAD + "  - {name: a, parameters: {EKF2_ACC_NOIS: 0.1}}\n", ("EKF2_ACC_NOIS", "unknown", "EKF2_ACC_NOISE")),
        (HEAD + "  - {name: a, parameters: {EKF2_ACC_NOISE: 3}}\n", ("sets[0]", "EKF2_ACC_NOISE", "3", "0.01 and 1")),
        (HEAD + "  - {name: a, parameters: {EKF2_GPS_DELAY: -1}}\n", ("EKF2_GPS_DELAY", "0 and 300")),
        (HEAD + "  - {name: a, parameters: {EKF2_GPS_CTRL: 1.5}}\n", ("EKF2_GPS_CTRL", "1.5", "whole number")),
        (HEAD + "  - {name: a, parameters: {EKF2_ACC_NOISE: high}}\n", ("EKF2_ACC_NOISE", "'high'", "a number")),
        (HEAD + "  - {name: a, parameters: {EKF2_ACC_NOISE: true}}\n", ("EKF2_ACC_NOISE", "true", "a number")),
        (
            HEAD + "  - {name: a, parameters: {EKF2_TAU_VEL: 0.2}}\n  - {name: A, parameters: {EKF2_TAU_VEL: 0.3}}\n",
            ("sets[1].name", "duplicate set name 'A'"),
        ),
        (HEAD + "  - {name: present, parameters: {EKF2_TAU_VEL: 0.2}}\n", ("present", "another name")),
        (HEAD + "  - {name: a b, parameters: {EKF2_TAU_VEL: 0.2}}\n", ("sets[0].name", "'a b'")),
        (HEAD + "  - {name: a, parameters: {}}\n", ("sets[0].parameters", "empty")),
        (HEAD + "  - {name: a, parameter: {EKF2_TAU_VEL: 0.2}}\n", ("parameter", "did you mean 'parameters'")),
        (HEAD + "  - {name: a}\n", ("sets[0]", "'parameters' is missing")),
        (HEAD + "  - {name: a, parameters: {EKF2_TAU_VEL: 0.2, EKF2_TAU_VEL: 0.3}}\n", ("EKF2_TAU_VEL", "twice", "4")),
        ("name: s\nkind: list\n", ("'sets' is missing",)),
        ("name: s\nkind: grid\nsets: []\n", ("sets", "vary")),
        ("name: s\nkind: spiral\nvary: {EKF2_TAU_VEL: [1]}\n", ("kind", "'spiral'", "'one_at_a_time'")),
        ("name: s\nkind: grid\nvary: {EKF2_TAU_VEL: [0.2, 0.2]}\n", ("vary.EKF2_TAU_VEL", "more than once")),
        (
            "name: s\nkind: grid\nfixed: {EKF2_TAU_VEL: 1}\nvary: {EKF2_TAU_VEL: [0.2]}\n",
            ("vary.EKF2_TAU_VEL", "fixed"),
        ),
        ("kind: list\nname: s\nsets: [\n", ("not valid YAML", "line")),
        ("- a\n- b\n", ("top level", "a list of 2", "mapping")),
        ("", ("top level", "empty")),
    ],
)
def test_broken_study_is_told_with_key_and_expectation(tmp_path: Path, text: str, expected: tuple[str, ...]) -> None:
    message = message_of(tmp_path, text)
    for words in expected:
        assert words in message


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    message = message_of(tmp_path, HEAD + "  - {name: a, parameters: {EKF2_ACC_NOISE: 3, EKF2_GYR_NOISE: 3}}\n")
    assert "EKF2_ACC_NOISE" in message
    assert "EKF2_GYR_NOISE" in message


def test_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be read"):
        load_study(tmp_path / "nothing.yaml")


LIST = "name: s\nkind: list\nsets:\n"


def a_set(name: str, value: str = "0.3") -> str:
    return f"- name: {name}\n  parameters: {{EKF2_ACC_NOISE: {value}}}\n"


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (LIST + a_set('"a\\n"'), ("sets[0].name", "'a\\n'")),
        (LIST + a_set("nul.txt"), ("sets[0].name", "'nul.txt'")),
        (LIST + a_set("CON"), ("sets[0].name", "'CON'", "Windows")),
        (LIST + a_set("scoring"), ("sets[0].name", "'scoring'")),
        (LIST + a_set("Fidelity"), ("sets[0].name", "'Fidelity'")),
        (LIST + a_set("Present"), ("sets[0].name", "'Present'")),
        (LIST + a_set("AS_FLOWN"), ("sets[0].name", "'AS_FLOWN'")),
        (LIST + a_set("a") + a_set("A"), ("sets[1].name", "duplicate", "case")),
        (LIST + a_set("a", ".nan"), ("sets[0].parameters.EKF2_ACC_NOISE is nan", "finite")),
        (LIST + a_set("a", "-.inf"), ("sets[0].parameters.EKF2_ACC_NOISE is -inf", "finite")),
        (LIST + a_set("a", "1e999"), ("sets[0].parameters.EKF2_ACC_NOISE is inf", "finite")),
        (LIST + a_set("a", "9" * 400), ("sets[0].parameters.EKF2_ACC_NOISE", "400 digits")),
        (LIST + a_set("a", "true"), ("sets[0].parameters.EKF2_ACC_NOISE is true", "number")),
        (LIST + a_set("a", "yes"), ("sets[0].parameters.EKF2_ACC_NOISE is true", "number")),
        (LIST + a_set("a", '"0.3"'), ("sets[0].parameters.EKF2_ACC_NOISE is '0.3'", "number")),
        (LIST + "".join(a_set(f"s{number}") for number in range(2001)), ("2001 sets", "at most 2000")),
    ],
)
def test_names_and_numbers_that_cannot_be_used_are_told_with_their_place(
    tmp_path: Path, text: str, parts: tuple[str, ...]
) -> None:
    message = message_of(tmp_path, text)
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_a_grid_beyond_all_bounds_is_refused_before_it_is_made(tmp_path: Path) -> None:
    """Five axes of a hundred values are 10¹⁰ sets."""
    values = ", ".join(str(0.001 + number / 1000) for number in range(100))
    parameters = ("ACC_NOISE", "GYR_NOISE", "BARO_NOISE", "MAG_NOISE", "GPS_V_NOISE")
    axes = "".join(f"  EKF2_{name}: [{values}]\n" for name in parameters)
    message = message_of(tmp_path, f"name: s\nkind: grid\nvary:\n{axes}")
    assert "10000000000 sets" in message
    assert "Vary fewer" in message


def test_descriptions_of_several_lines_become_one(tmp_path: Path) -> None:
    head = LIST.replace("kind", "description: |\n  first\n  second\nkind")
    study = load_study(write(tmp_path, head + a_set("a") + "  description: |\n   x\n   y\n"))
    assert study.description == "first second"
    assert study.sets[0].description == "x y"


def test_what_newer_releases_call_otherwise_is_translated_and_what_they_alone_have_needs_one(tmp_path: Path) -> None:
    file = tmp_path / "newer.yaml"
    file.write_text(
        "name: newer\nkind: grid\nvary: {SENS_GPS0_DELAY: [80, 160], EKF2_ASP_DELAY: [100]}\n"
        'constraints: ["EKF2_ASP_DELAY < SENS_GPS0_DELAY"]\n'
    )
    assert [one.overrides for one in load_study(file).sets] == [{"EKF2_GPS_DELAY": 160.0, "EKF2_ASP_DELAY": 100.0}]
    file.write_text("name: own\nkind: one_at_a_time\nvary: {EKF2_GPS_MODE: [0, 1]}\n")
    with pytest.raises(UserError, match=r"EKF2_GPS_MODE: v1\.16 has no such parameter, v1\.17 to main have it"):
        load_study(file)
    assert [one.overrides for one in load_study(file, "v1.17").sets] == [{"EKF2_GPS_MODE": 0}, {"EKF2_GPS_MODE": 1}]
    twice = "{SENS_GPS0_DELAY: 80, EKF2_GPS_DELAY: 90}"
    file.write_text(f"name: twice\nkind: one_at_a_time\nfixed: {twice}\nvary: {{EKF2_ACC_NOISE: [1]}}\n")
    with pytest.raises(UserError, match="SENS_GPS0_DELAY is what newer releases call EKF2_GPS_DELAY"):
        load_study(file)
