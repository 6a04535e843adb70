"""Decisions are kept, and judged on the flights that flew them, from the files that the pipeline has."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pytest
from tests.analyze.made_flight import MadeSet, make_flight
from tests.apply.study import make_study

from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.apply.decide import decide
from fusetune.apply.history.entries import AFTER, BEFORE, history_file, read_history
from fusetune.apply.history.flown import flights_of_changes
from fusetune.apply.history.keep import keep_history
from fusetune.apply.history.words import history_lines
from fusetune.apply.settings import DecisionSettings
from fusetune.cli import main
from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.report.sections.history_section import history_section
from fusetune.save.flight_folder import write_flight
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.parquet import read_table, write_table

VEHICLE = VehicleIdentity("0123", "PX4_FMU_V5", "4001", "quadrotor")
OLD, NEW = {"EKF2_ACC_NOISE": 0.35, "EKF2_GYR_NOISE": 0.015}, {"EKF2_ACC_NOISE": 0.2, "EKF2_GYR_NOISE": 0.015}
SETTINGS = DecisionSettings(draws=200)
FLIGHTS = 5


def save(folder: Path, name: str, values: dict[str, float]) -> None:
    """A saved flight that had these parameters."""
    folder.mkdir(parents=True, exist_ok=True)
    flight = Flight(name, parameters=ParameterHistory(dict(values)), checksum=name)
    write_flight(folder, flight, {"ekf2_parameters": values})


@dataclass
class Kept:
    """A study that was decided, with its files."""

    root: Path

    @property
    def apply(self) -> Path:
        return self.root / "apply"

    @property
    def history(self) -> Path:
        return history_file(self.root / "history", VEHICLE)

    def keep(self, measured: dict[str, list[Path]]) -> str:
        output = self.apply / "history.json"
        table, saved = self.root / "flights.parquet", self.root / "saved"
        keep_history(self.apply, table, saved, measured, self.root / "history", output, SETTINGS)
        return self.history.read_text()


@pytest.fixture(scope="module")
def decided(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five flights with the old values, of which another set is chosen."""
    root = tmp_path_factory.mktemp("decided")
    sets = {"present": MadeSet(error=0.13, overrides=OLD), "better": MadeSet(error=0.1, overrides=NEW)}
    folders, file = make_study(root, sets, FLIGHTS, vehicles=[VEHICLE] * FLIGHTS)
    table = read_table(file)
    days = pa.array([f"2026-01-0{number + 1}T10:00:00Z" for number in range(FLIGHTS)])
    checksums = pa.array([folder.name for folder in folders])
    table = table.set_column(table.column_names.index("checksum"), "checksum", checksums)
    write_table(table.append_column("recorded", days), file)
    for folder in folders:
        save(root / "saved" / folder.name, folder.name, OLD)
    decide(folders, file, root / "apply", sets=list(sets), settings=SETTINGS)
    return root


@pytest.fixture
def kept(decided: Path, tmp_path: Path) -> Kept:
    for part in ("apply", "saved"):
        shutil.copytree(decided / part, tmp_path / part)
    shutil.copyfile(decided / "flights.parquet", tmp_path / "flights.parquet")
    return Kept(tmp_path)


def test_a_decision_is_kept_once_with_what_it_rests_on(kept: Kept) -> None:
    first = kept.keep({})
    assert kept.keep({}) == first
    (entry,) = read_history(kept.history).decisions
    assert (entry.status, entry.chosen, entry.changes) == ("change", "better", {"EKF2_ACC_NOISE": 0.2})
    assert entry.decided_after == "2026-01-05T10:00:00Z"
    decision = read_document(kept.apply / "decision.json")
    better = next(one for one in decision["ranking"] if one["name"] == "better")
    assert entry.predicted.percent == better["improvement_percent"]
    assert [one.flight for one in entry.evidence] == [f"flight_{number}" for number in range(FLIGHTS)]
    assert {one["name"] for one in entry.sets} == {"present", "better"}
    assert "not yet known: no flight with it so far" in list(history_lines(read_history(kept.history)))[-1]


def test_flights_that_flew_it_confirm_it_and_their_absence_takes_nothing_back(
    kept: Kept, capsys: pytest.CaptureFixture[str]
) -> None:
    before = kept.keep({})
    (entry,) = read_history(kept.history).decisions
    rows = read_table(kept.root / "flights.parquet").to_pylist()
    for number, values in enumerate((NEW, NEW, OLD)):
        save(kept.root / "saved" / f"after_{number}", f"after_{number}", values)
        day = f"2026-02-0{number + 1}T10:00:00Z"
        rows.append({**rows[0], "flight": f"after_{number}", "recorded": day})
    followed = flights_of_changes(kept.root / "history", rows, kept.root / "saved")
    values = {"before": {"EKF2_ACC_NOISE": 0.35}, "after": {"EKF2_ACC_NOISE": 0.2}}
    assert followed == {name: {"of": entry.key, **values} for name in ("after_0", "after_1")}

    sets = {BEFORE: MadeSet(error=0.13), AFTER: MadeSet(error=0.1)}
    folders = []
    for number in range(3):
        saved, folder = make_flight(kept.root / "measured", f"after_{number}", sets, seed=200 + number)
        score_saved_flight(saved, folder, list(sets), present=BEFORE)
        summary = read_document(folder / "scoring.json") | {"checksum": f"after_{number}"}
        write_document(folder / "scoring.json", summary)
        folders.append(folder)
    after = kept.keep({entry.key: folders})
    assert after.startswith(before)
    history = read_history(kept.history)
    outcome = history.outcome_of(history.decisions[0])
    assert outcome is not None
    assert (outcome.status, outcome.against_prediction) == ("confirmed", "as predicted")
    # fewer of these flights are no news, and neither are the same
    assert kept.keep({entry.key: folders}) == kept.keep({entry.key: folders[:2]}) == after
    page = history_section(read_document(kept.apply / "history.json"))
    assert "EKF2_ACC_NOISE 0.35 → 0.2 m/s²" in page
    assert "confirmed, as predicted" in page

    capsys.readouterr()
    assert main(["history", "PX4_FMU_V5", "--folder", str(kept.root / "history")]) == 0
    said = capsys.readouterr().out
    assert "quadrotor PX4_FMU_V5-0123-4001: 1 decision, 1 change" in said
    assert "measured on 3 flights after it" in said
    assert main(["history", "other", "--folder", str(kept.root / "history")]) == 2
    assert "no history of 'other'" in capsys.readouterr().err


def test_a_damaged_history_stops_what_would_add_to_it(kept: Kept) -> None:
    kept.keep({})
    text = kept.history.read_text().replace('"better"', '"bitter"', 1)
    kept.history.write_text(text)
    with pytest.raises(Exception, match="line 1 is not what was written"):
        kept.keep({})
    assert kept.history.read_text() == text


def test_mlflow_has_a_run_for_each_decision_and_each_set(kept: Kept, capsys: pytest.CaptureFixture[str]) -> None:
    kept.keep({})
    pytest.importorskip("mlflow", reason="needs the extra mlflow: pip install -r requirements-mlflow.lock")
    from mlflow import MlflowClient

    from fusetune.apply.history.mlflow_export import store_of

    folder = kept.root / "mlflow"
    arguments = ["history", "--folder", str(kept.root / "history"), "--mlflow", str(folder)]
    assert main(arguments) == 0
    assert "3 runs added" in capsys.readouterr().out
    client = MlflowClient(store_of(folder))
    experiment = client.get_experiment_by_name(VEHICLE.name)
    runs = {run.info.run_name: run for run in client.search_runs([experiment.experiment_id])}
    assert set(runs) == {"change: better", "present", "better"}
    parent, better = runs["change: better"], runs["better"]
    assert better.data.tags["mlflow.parentRunId"] == parent.info.run_id
    assert float(better.data.params["EKF2_ACC_NOISE"]) == pytest.approx(0.2)
    (entry,) = read_history(kept.history).decisions
    assert better.data.metrics["gain_percent"] == entry.predicted.percent == parent.data.metrics["predicted_percent"]
    assert main(arguments) == 0
    assert "0 runs added" in capsys.readouterr().out
