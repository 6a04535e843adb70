"""An effect that is told wrong, from simulated logs to the decision: measured, compared, chosen, and right."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from fusetune.analyze.analyze_flight import AnalysisSettings, analyze_flight
from fusetune.analyze.diagnose_flight import diagnose_flight
from fusetune.analyze.effects.joined_effects import write_joined_effects
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.apply.decide import decide
from fusetune.apply.settings import DecisionSettings
from fusetune.design.missions.mission import load_mission
from fusetune.execute import simulate
from fusetune.execute.vehicle import load_vehicle
from fusetune.save import save_log
from fusetune.save.flights_table import write_flights_table
from fusetune.set_names import AS_FLOWN, PRESENT

FLIGHTS = 4
FORWARD_M = -0.64
"""Where the antenna sits; the vehicle is told −0.04."""
SETTINGS = AnalysisSettings(
    scoring=ScoringSettings(minimum_scored_s=5.0, settle_s=1.0, block_s=5.0), trust=TrustSettings(causes=False)
)


@pytest.fixture(scope="module")
def flights(project_root: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Saved flights of a vehicle whose antenna sits 0.6 m behind where it is told, by name."""
    folder = tmp_path_factory.mktemp("antenna")
    plain = load_vehicle(project_root / "config" / "vehicles" / "quadrotor.yaml")
    _, *others = plain.gnss.antenna_position_m
    vehicle = replace(plain, gnss=replace(plain.gnss, antenna_position_m=(FORWARD_M, *others)))
    mission = load_mission(project_root / "config" / "missions" / "short_survey.yaml")
    saved = {}
    for seed in range(1, FLIGHTS + 1):
        log = folder / f"flight_{seed}.ulg"
        simulate(mission, vehicle, {}, seed, (), log)
        save_log(log, folder / "save" / log.stem)
        saved[log.stem] = folder / "save" / log.stem
    return saved


def test_an_antenna_that_is_told_wrong_is_measured_compared_and_chosen(
    flights: dict[str, Path], tmp_path: Path
) -> None:
    newest, table = f"flight_{FLIGHTS}", tmp_path / "flights.parquet"
    write_flights_table(list(flights.values()), table, table.with_suffix(".csv"))
    analyzed = {name: tmp_path / "analyze" / name for name in flights}
    for name, folder in flights.items():
        diagnose_flight(folder, analyzed[name])
    told = {name: folder / "effects.json" for name, folder in analyzed.items()}
    joined = write_joined_effects(told, newest, table, tmp_path / "effects.json")
    measured = joined.sets["antenna_mended"]
    assert measured["EKF2_GPS_POS_X"] == pytest.approx(FORWARD_M, abs=0.05)

    sets = {PRESENT: {}, "antenna_mended": measured}
    for name, folder in flights.items():
        analyze_flight(folder, analyzed[name], sets | {AS_FLOWN: {}}, list(sets), settings=SETTINGS)
    decide(
        list(analyzed.values()),
        table,
        tmp_path / "apply",
        sets=list(sets),
        newest_flight=newest,
        effects=tmp_path / "effects.json",
        settings=DecisionSettings(draws=200),
    )
    decision = json.loads((tmp_path / "apply" / "decision.json").read_text(encoding="utf-8"))
    assert (decision["status"], decision["chosen"]) == ("change", "antenna_mended")
    changed = {one["name"]: one["value"] for one in decision["changes"]}
    assert changed["EKF2_GPS_POS_X"] == pytest.approx(FORWARD_M, abs=0.05)
    (finding,) = (one for one in decision["findings"] if one["id"] == "effect.gnss_antenna")
    assert finding["remedy"].startswith("Set by the choice: EKF2_GPS_POS_X to -0.")
    # the reference is made with the place that is measured: with the one that is told it would hold the same error
    (chosen,) = (one for one in decision["ranking"] if one["name"] == "antenna_mended")
    assert chosen["aims"]["smoothed"]["difference"] < -0.3
