"""A folder of results as a run leaves it, made of a small study."""

from __future__ import annotations

import os
from pathlib import Path

from tests.analyze.made_flight import MadeSet
from tests.apply.study import make_study

from fusetune.apply.decide import decide
from fusetune.apply.results_folder import ResultsFolder
from fusetune.apply.settings import DecisionSettings
from fusetune.save.present import Present, write_present

SETS = {
    "present": MadeSet(error=0.13, overrides={"EKF2_ACC_NOISE": 0.35}),
    "better": MadeSet(error=0.1, overrides={"EKF2_ACC_NOISE": 0.2}),
    "worse": MadeSet(error=0.16, overrides={"EKF2_ACC_NOISE": 0.9}),
}
FLIGHTS = 5
SETTINGS = DecisionSettings(draws=200, seed=3)


def make_results(folder: Path) -> ResultsFolder:
    """Make it: five flights on which one set is better and one worse."""
    folders, table = make_study(folder, SETS, FLIGHTS, refused=("bad",))
    os.replace(table, folder / "save" / "flights.parquet")
    newest = folders[-1].name
    write_present(folder / "save" / "present.json", Present(newest, "ab" * 32, {"EKF2_ACC_NOISE": 0.35}, [newest]))
    decide(
        folders,
        folder / "save" / "flights.parquet",
        folder / "apply",
        sets=list(SETS),
        newest_flight=newest,
        same_present=[newest],
        descriptions={"better": "less noise"},
        saved=folder / "save",
        settings=SETTINGS,
    )
    return ResultsFolder(folder)
