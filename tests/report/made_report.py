"""The whole report of a made study."""

from pathlib import Path
from typing import Any

from tests.analyze.made_flight import MadeSet
from tests.apply.study import make_study
from tests.report.read_page import check_page

from fusetune.apply.decide import decide
from fusetune.report.page import ReportInput, build_report
from fusetune.storage.documents import write_document

SETS = {
    "present": MadeSet(error=0.13, overrides={"EKF2_ACC_NOISE": 0.35}),
    "better": MadeSet(error=0.1, overrides={"EKF2_ACC_NOISE": 0.2}),
    "drifting": MadeSet(error=0.11, drift=5.0, overrides={"EKF2_ACC_NOISE": 0.9}),
    "<restless>": MadeSet(resets_s=(40.0, 50.0)),
}
"""One set to choose, one that is better one step ahead and worse without GNSS, one that is vetoed."""


def make_report(
    root: Path,
    sets: dict[str, MadeSet],
    flights: int,
    landing_s: float = 70.0,
    fidelity: dict[str, Any] | None = None,
) -> str:
    """Make and score flights, decide, and return the page; all files lie below `root`.

    `fidelity` is what the grade of every flight is read from; its section of the page is left out.
    """
    folders, table = make_study(root, sets, flights, refused=("bad",), landing_s=landing_s)
    for folder in folders if fidelity else ():
        write_document(folder / "fidelity.json", fidelity)
    decide(folders, table, root / "apply", sets=list(sets))
    for folder in folders if fidelity else ():
        (folder / "fidelity.json").unlink()
    build_report(made_input(root), root / "report.html")
    return check_page((root / "report.html").read_text(encoding="utf-8")).source


def made_input(root: Path, **more: Any) -> ReportInput:
    """What the report of a made study is built from."""
    folders = sorted((root / "analyze").iterdir()) if (root / "analyze").is_dir() else []
    return ReportInput(root / "flights.parquet", folders, root / "apply", **more)
