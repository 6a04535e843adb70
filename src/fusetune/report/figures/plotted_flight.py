"""A flight as its figures show it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise, sensor_noise_of
from fusetune.errors import UserError
from fusetune.report.flight_data.content import Band, Panel, ShownSet, TrackView
from fusetune.report.flight_data.flight_content import LABELS, flight_content
from fusetune.report.flight_data.shown_sets import Choice
from fusetune.storage.files import AnyPath

_USUAL_ROLES = ("present", "chosen", "onboard", "as_flown")


class FlightFolders(NamedTuple):
    """Of a flight as the rooms left it: `results/save/<flight>` and `results/analyze/<flight>`."""

    saved: Path
    analyzed: Path


@dataclass(frozen=True)
class PlottedFlight:
    """What the figures of a flight are drawn from.

    Attributes
    ----------
    start_us : when its log begins, µs since boot
    why_not_replayed : of a log that is not; empty of others
    folders : of results; None of a log
    characterise : asked once, when its sensors are drawn
    labels : of sets whose names say too little
    """

    name: str
    start_us: int
    duration_s: float
    sets: tuple[ShownSet, ...]
    panels: tuple[Panel, ...]
    bands: tuple[Band, ...]
    track: TrackView | None
    characterise: Callable[[], SensorNoise]
    labels: Mapping[str, str]
    why_not_replayed: str = ""
    folders: FlightFolders | None = None

    @property
    def usual_sets(self) -> tuple[str, ...]:
        """What flies now, what is chosen, and the vehicle's own filter: more curves than these hide each other."""
        return tuple(one.name for one in self.sets if one.role in _USUAL_ROLES)

    @cached_property
    def noise(self) -> SensorNoise:
        """Its sensors."""
        return self.characterise()


def flight_of_results(results: AnyPath, flight: str, sets: Sequence[str], choice: Choice) -> PlottedFlight:
    """Of a results folder.

    Parameters
    ----------
    sets : shown beside the present one; without any those that were scored

    Raises
    ------
    UserError
        The folder does not hold the flight, or a file of it is damaged.
    """
    save, analyze = Path(results) / "save" / flight, Path(results) / "analyze" / flight
    if not analyze.is_dir():
        raise UserError(analyze, "there is no such flight", "Name one of the folders beside it")
    content = flight_content(save, analyze, sets, choice)
    return PlottedFlight(flight, content.start_us, content.duration_s, content.sets, content.panels, content.bands,
                         content.track, lambda: sensor_noise_of(save), LABELS,
                         folders=FlightFolders(save, analyze))  # fmt: skip
