"""What is shown of a flight is what its files hold: Parquet, decision, health and diagnosis."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from tests.analyze.made_flight import LANDING_S, START_US, TAKE_OFF_S, MadeSet
from tests.apply.study import make_study
from tests.report.made_health import LANDING_S as MADE_LANDING_S
from tests.report.made_health import LATE, health_rows, rejected, write_documents, write_log
from tests.report.made_health import TAKE_OFF_S as MADE_TAKE_OFF_S

from fusetune.apply.decide import decide
from fusetune.report.flight_data.blob import Blob, unpack
from fusetune.report.flight_data.panel_names import GROUPS
from fusetune.report.flight_data.shown_sets import relative_errors, replayed_sets
from fusetune.report.flight_data.write_blob import pack_flight, with_choice, write_blob
from fusetune.report.set_styles import set_styles
from fusetune.set_names import PRESENT
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.parquet import read_table

RESTLESS = "<restless>"


SETS = {
    PRESENT: MadeSet(error=0.13, overrides={"EKF2_ACC_NOISE": 0.35}),
    "better": MadeSet(error=0.1, overrides={"EKF2_ACC_NOISE": 0.2}),
    RESTLESS: MadeSet(resets_s=(40.0, 50.0)),
}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a study of made flights, with its decision."""
    root = tmp_path_factory.mktemp("results")
    folders, table = make_study(root, SETS, 5)
    decide(folders, table, root / "apply", sets=list(SETS))
    return root


@pytest.fixture(scope="module")
def folders(study: Path) -> tuple[Path, Path]:
    """A saved flight, and what was found of it: scored sets, a cause and a figure beyond its limit."""
    analyzed = study / "analyze" / "flight_0"
    write_documents(analyzed, (LATE,), health_rows(rejected("gnss_vel_vertical", 0.2, 22.0, 30.0)))
    return study / "save" / "flight_0", analyzed


@pytest.fixture(scope="module")
def blob(folders: tuple[Path, Path]) -> Blob:
    packed = pack_flight(*folders)
    assert packed is not None
    return unpack(packed)


def panel(blob: Blob, name: str) -> dict:
    return next(one for one in blob.header["panels"] if one["id"] == name)


def series(blob: Blob, name: str, of: str | None) -> dict:
    return next(one for one in panel(blob, name)["series"] if one["set"] == of)


def seconds(time_us: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    return np.round((time_us - START_US) * 1e-6, 4)


def rows_of(path: Path, source: str, axis: int, **equal: str) -> dict[str, npt.NDArray]:
    table = read_table(path).to_pandas()
    table = table[(table["source"] == source) & (table["axis"] == axis)]
    for name, value in equal.items():
        table = table[table[name.removesuffix("_")] == value]
    return {name: table[name].to_numpy() for name in table}


@pytest.mark.parametrize(("source", "axis"), [("gnss_vel", 0), ("gnss_pos", 1), ("baro_hgt", 0)])
def test_innovations_are_those_of_the_replay(blob: Blob, folders: tuple[Path, Path], source: str, axis: int) -> None:
    rows = rows_of(folders[1] / "present.innovations.parquet", source, axis)
    kept = (np.cumsum(rows["fused"]) > 0) & (rows["timestamp_sample"] >= START_US)
    one = series(blob, f"innovation.{source}.{axis}", PRESENT)
    np.testing.assert_allclose(blob.arrays[one["time"]], seconds(rows["timestamp_sample"][kept]), atol=1e-9)
    np.testing.assert_allclose(blob.arrays[one["value"]], rows["innovation"][kept], rtol=2**-17)
    sigma = np.sqrt(rows["innovation_variance"][kept])
    np.testing.assert_allclose(blob.arrays[one["sigma"]], sigma, rtol=2**-16)
    assert one["gate"] == 5.0


def test_innovations_of_other_sets_are_the_scored_samples(blob: Blob, folders: tuple[Path, Path]) -> None:
    for name in ("better", RESTLESS):
        rows = rows_of(folders[1] / "samples.parquet", "gnss_vel", 2, set=name)
        one = series(blob, "innovation.gnss_vel.2", name)
        found = blob.arrays[one["value"]]
        known = np.isfinite(found)
        np.testing.assert_allclose(blob.arrays[one["time"]][known], seconds(rows["time_us"]), atol=1e-9)
        np.testing.assert_allclose(found[known], rows["innovation"], rtol=2**-17)


def test_the_motion_is_that_of_the_replay(blob: Blob, folders: tuple[Path, Path]) -> None:
    rows = read_table(folders[1] / "present.local_position.parquet").to_pandas()
    for name, column, sign in (("velocity.0", "vx", 1.0), ("position.0", "x", 1.0), ("height", "z", -1.0)):
        one = series(blob, name, PRESENT)
        np.testing.assert_allclose(blob.arrays[one["value"]], sign * rows[column], rtol=2**-17)
    # level, north: the made states hold the quaternion (1, 0, 0, 0) throughout
    truth = series(blob, "attitude.2", None)
    assert truth["label"] == "truth"
    assert not blob.arrays[truth["value"]].any()


def test_uncertainty_is_the_root_of_the_variances(blob: Blob) -> None:
    """All variances of the made states are 0.01: two axes together have a standard deviation of √0.02."""
    for name, expected in (("position_sigma.0", 0.02), ("position_sigma.1", 0.01), ("attitude_sigma.1", 0.01)):
        one = series(blob, name, PRESENT)
        np.testing.assert_allclose(blob.arrays[one["value"]], np.sqrt(expected), rtol=2**-16)
    bias = series(blob, "gyro_bias.0", PRESENT)
    np.testing.assert_allclose(blob.arrays[bias["sigma"]], 0.1, rtol=2**-16)


def test_panels_stand_in_the_order_of_the_groups(blob: Blob) -> None:
    places = [GROUPS.index(one["group"]) for one in blob.header["panels"]]
    assert places == sorted(places)
    ids = [one["id"] for one in blob.header["panels"]]
    assert len(set(ids)) == len(ids)
    assert not any(one.startswith(("wind", "terrain", "airspeed")) for one in ids), "nothing tells of these"


def test_findings_are_marks_and_flags_are_bands(blob: Blob) -> None:
    header = blob.header
    assert (header["takeoff_s"], header["landing_s"]) == (MADE_TAKE_OFF_S, MADE_LANDING_S)
    assert [one["id"] for one in header["marks"]] == [LATE.id, "gnss_vel_vertical.rejected_share"]
    assert (header["marks"][1]["t0"], header["marks"][1]["t1"]) == (22.0, 30.0)
    bands = {one["id"]: one["spans"] for one in header["bands"]}
    assert bands["in_air"] == [[TAKE_OFF_S, LANDING_S, ""]]
    assert bands["cs_gnss_pos"] == [[5.0, 75.0, ""]]
    assert bands["cs_inertial_dead_reckoning"] == [[0.0, 5.0, ""]]
    assert "cs_baro_fault" not in bands


def test_sets_have_the_part_that_the_decision_gave_them(folders: tuple[Path, Path], study: Path) -> None:
    packed = pack_flight(*folders)
    assert packed is not None
    before = {one["name"]: one for one in unpack(packed).header["sets"]}
    assert {name: one["role"] for name, one in before.items()} == {
        PRESENT: "present", "better": "candidate", RESTLESS: "candidate"
    }  # fmt: skip
    decision = read_document(study / "apply" / "decision.json")
    assert decision["chosen"] == "better"
    styles = set_styles(SETS, PRESENT, decision["chosen"])
    decided = unpack(with_choice(packed, decision["chosen"], (RESTLESS,), styles))
    after = {one["name"]: one for one in decided.header["sets"]}
    assert after[decision["chosen"]]["role"] == "chosen"
    assert (after[PRESENT]["role"], after[RESTLESS]["role"]) == ("present", "ruled_out")
    for name, one in after.items():
        assert (one["style"], one["marker"]) == (styles[name].index, styles[name].marker)
    chosen = [
        one["style"] for one in panel(decided, "innovation.gnss_vel.0")["series"] if one["set"] == decision["chosen"]
    ]
    assert chosen == [styles[decision["chosen"]].index]


def test_resets_are_events_and_step_the_track_of_their_set(folders: tuple[Path, Path], tmp_path: Path) -> None:
    """The replay of a set that resets its position at 40 and 50 s, taken for the present one."""
    analyzed = tmp_path / "flight_0"
    shutil.copytree(folders[1], analyzed)
    for file in analyzed.glob(f"{RESTLESS}.*"):
        shutil.copyfile(file, analyzed / file.name.replace(RESTLESS, PRESENT))
    packed = pack_flight(folders[0], analyzed)
    assert packed is not None
    events = unpack(packed).header["events"]
    assert [(one["t"], one["kind"], one["title"]) for one in events] == [
        (seconds_of, "reset", "reset of horizontal position; in the replay") for seconds_of in (40.0, 50.0)
    ]


def test_a_refused_log_shows_what_it_has(tmp_path: Path) -> None:
    """The vehicle's own filter and its sensors: neither replays nor scores, nor a track."""
    saved = write_log(tmp_path / "save" / "refused")
    folder = write_documents(
        tmp_path / "analyze" / "refused", (), health_rows(), refused=({"found": "no IMU", "remedy": ""},)
    )
    small, large = tmp_path / "small.blob", tmp_path / "large.blob"
    assert write_blob(saved, folder, small, large)
    found = unpack(small.read_bytes())
    assert [one["role"] for one in found.header["sets"]] == ["onboard"]
    assert found.header["track"] is None
    ids = {one["id"] for one in found.header["panels"]}
    assert {"innovation.gnss_vel.2", "velocity.2", "height"} <= ids
    assert unpack(large.read_bytes()).header["panels"][0]["id"] == found.header["panels"][0]["id"]


def test_a_log_of_which_nothing_could_be_read_has_no_blob(tmp_path: Path) -> None:
    saved = tmp_path / "save" / "broken"
    saved.mkdir(parents=True)
    write_document(saved / "metadata.json", {"name": "broken"})
    folder = write_documents(tmp_path / "analyze" / "broken", readable=False)
    assert pack_flight(saved, folder) is None
    assert not write_blob(saved, folder, tmp_path / "broken.blob")
    assert (tmp_path / "broken.blob").read_bytes() == b""


def test_the_same_files_give_the_same_bytes(folders: tuple[Path, Path]) -> None:
    assert pack_flight(*folders, 50_000) == pack_flight(*folders, 50_000)


def test_of_too_many_sets_those_are_shown_that_predict_best(folders: tuple[Path, Path]) -> None:
    """The made errors are 0.13 m/s of the present set, 0.1 of both others, of which one resets."""
    scoring, scores = read_document(folders[1] / "scoring.json"), folders[1] / "scores.parquet"
    assert replayed_sets(scoring, scores) == [PRESENT, *(name for name in scoring["sets"] if name != PRESENT)]
    assert replayed_sets(scoring, scores, ("better",))[:2] == [PRESENT, "better"]
    errors = relative_errors(scores, PRESENT)
    assert errors[PRESENT] == 0.0
    assert errors["better"] == pytest.approx(np.log(0.1 / 0.13), abs=0.03)
    best = min((name for name in errors if name != PRESENT), key=lambda name: errors[name])
    assert replayed_sets(scoring, scores, most=1) == [PRESENT, best]
    worst = max((name for name in errors if name != PRESENT), key=lambda name: errors[name])
    assert replayed_sets(scoring, scores, (worst,), most=1) == [PRESENT, worst], "what is asked for is shown"
    assert replayed_sets(None, scores) == []
