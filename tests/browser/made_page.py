"""A small report with everything that its viewer can show, and the files it was made from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tests.analyze.made_flight import START_US, TAKE_OFF_S, MadeSet
from tests.apply.study import make_study
from tests.report.made_health import LATE, SHAKEN, write_documents
from tests.report.made_report import SETS

from fusetune.analyze.conformance.flown_track import FlownTrack
from fusetune.analyze.conformance.track_file import write_track
from fusetune.analyze.flight_files import CONFORMANCE_FILE, TRACK_FILE
from fusetune.apply.decide import decide
from fusetune.report.flight_data.write_blob import write_blob
from fusetune.report.page import ReportInput, build_report
from fusetune.storage.documents import write_document

REJECTING = {"rejecting": MadeSet(error=0.9, claimed=0.2, overrides={"EKF2_GPS_V_NOISE": 0.1})}
"""Claims a fourth of its error, so that some samples lie beyond the gate of five standard deviations."""
SIDE_M = 40.0
"""Of the square that is flown."""
LONG_NAME = "paper5+delay_mended+antenna_mended+barometer_mended_of_a_name_that_does_not_end"


@dataclass(frozen=True)
class MadePage:
    """The report and what it was made from.

    Attributes
    ----------
    report : the page
    folders : `results/analyze/<flight>`
    blobs : of the same flights
    """

    report: Path
    folders: tuple[Path, ...]
    blobs: tuple[Path, ...]

    @property
    def url(self) -> str:
        return self.report.as_uri()

    @property
    def flights(self) -> list[str]:
        return [folder.name for folder in self.folders]


def make_page(root: Path) -> MadePage:
    """Make, score and pack two flights, decide, and write the report."""
    sets = SETS | REJECTING | {LONG_NAME: MadeSet(error=0.12, overrides={"EKF2_ACC_NOISE": 0.3})}
    folders, table = make_study(root, sets, 2, refused=("bad",))
    blobs = []
    for folder in folders:
        write_documents(folder, [SHAKEN, LATE])
        write_track(folder / TRACK_FILE, square())
        manoeuvres = [
            {"start_us": START_US + round(t * 1e6), "stop_us": START_US + round((t + 12.0) * 1e6), "kind": kind}
            for t, kind in ((TAKE_OFF_S, "straight"), (TAKE_OFF_S + 15.0, "turn"), (TAKE_OFF_S + 30.0, "hover"))
        ]
        write_document(folder / CONFORMANCE_FILE, {"missions": [], "flown": None, "manoeuvres": manoeuvres})
        blobs.append(root / "report" / "flights" / f"{folder.name}.blob")
        blobs[-1].parent.mkdir(parents=True, exist_ok=True)
        write_blob(root / "save" / folder.name, folder, blobs[-1])
    decide(folders, table, root / "apply", sets=list(sets))
    report = root / "report.html"
    build_report(ReportInput(table, folders, root / "apply", blobs=blobs), report)
    return MadePage(report, tuple(folders), tuple(blobs))


def square() -> FlownTrack:
    """A square to the north and east in 60 s, 10 m high."""
    seconds = np.arange(0.0, 75.0, 0.1)
    part = np.clip((seconds - TAKE_OFF_S) / 15.0, 0.0, 4.0)
    north = SIDE_M * np.interp(part, [0, 1, 2, 3, 4], [0, 1, 1, 0, 0])
    east = SIDE_M * np.interp(part, [0, 1, 2, 3, 4], [0, 0, 1, 1, 0])
    metres_per_degree = 111_195.0
    nothing = np.full(seconds.size, np.nan)
    return FlownTrack(
        source="estimate",
        time=START_US + np.round(seconds * 1e6).astype(np.int64),
        lat=47.0 + north / metres_per_degree,
        lon=8.0 + east / (metres_per_degree * np.cos(np.radians(47.0))),
        height=10.0 * np.interp(part, [0, 0.2, 3.8, 4], [0, 1, 1, 0]),
        velocity=np.zeros((seconds.size, 3)),
        heading=np.radians(90.0) * np.minimum(np.floor(part), 3.0),
        horizontal_sigma=nothing,
        vertical_sigma=nothing,
        is_above_takeoff=True,
        airborne=((int(START_US + TAKE_OFF_S * 1e6), int(START_US + 70e6)),),
    )
