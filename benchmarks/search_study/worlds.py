"""The worlds of the study: those of the decision study, and vehicles that are told wrong; flights of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.decision_study.collect import StudyFiles, replay_settings, saved_flight

from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.apply.search.measured_place import ARM, DELAY

HERE = Path(__file__).parent
DECISION, TOLD_WRONG = StudyFiles(), StudyFiles(worlds=HERE / "worlds.yaml")
SEARCHED, FRESH = range(8), range(8, 16)
"""Numbers of the flights that are searched on, and of those on which the truth judges."""


@dataclass(frozen=True)
class SearchWorld:
    """A world and where its flights are saved.

    Attributes
    ----------
    right : what the vehicle should be told, where that follows from the world; of noises the truth has to say it
    wrong : names of all parameters that it is told wrong
    """

    name: str
    files: StudyFiles
    described: Mapping[str, Any]
    saved: Path

    @property
    def right(self) -> dict[str, float]:
        return dict(self.described.get("right", {}))

    @property
    def right_place(self) -> dict[str, float]:
        """Delay and place of the GNSS antenna, as far as the world names them."""
        gnss = self.described.get("second", {}).get("gnss", {})
        delay = {DELAY: float(gnss["delay_ms"])} if "delay_ms" in gnss else {}
        return delay | dict(zip(ARM, map(float, gnss.get("antenna_m", ())), strict=False))

    @property
    def wrong(self) -> tuple[str, ...]:
        return (*self.right, *self.described.get("wrong_noises", ()))

    @property
    def settings(self) -> ReplaySettings:
        """How its flights are replayed."""
        return replay_settings(self.described)

    def flights(self, numbers: range) -> list[Path]:
        """Folders of saved flights; what is not there is flown."""
        return [saved_flight(self.files, self.saved, self.name, number) for number in numbers]


def search_worlds(saved: Path) -> dict[str, SearchWorld]:
    """All worlds by name, those of the decision study first."""
    return {
        name: SearchWorld(name, files, described, saved)
        for files in (DECISION, TOLD_WRONG)
        for name, described in files.worlds_by_name().items()
    }
