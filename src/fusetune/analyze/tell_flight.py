"""Everything told of a saved flight in one job, of which only what is out of date is done: diagnosis, delays, mission.

A newer present set asks for the delays again, a changed mission for its comparison; neither for the diagnosis.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fusetune.analyze.conformance.conformance_files import write_conformance
from fusetune.analyze.conformance.settings import DEFAULTS as OF_CONFORMANCE
from fusetune.analyze.conformance.settings import ConformanceSettings
from fusetune.analyze.diagnose_flight import diagnose_flight, estimate_delays
from fusetune.analyze.flight_files import CONFORMANCE_FILE, DELAYS_FILE, DIAGNOSED_FILES, TRACK_FILE
from fusetune.analyze.health.health_table import DEFAULTS as OF_HEALTH
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.save.flight_folder import METADATA_FILE
from fusetune.storage.files import AnyPath, sha256_of
from fusetune.storage.ledger import Ledger, key_of

LEDGER_FILE = ".told.made.json"
DIAGNOSIS, DELAYS, CONFORMANCE = "diagnosis", "delays", "conformance"
FILES: Mapping[str, tuple[str, ...]] = {
    DIAGNOSIS: (*DIAGNOSED_FILES, TRACK_FILE),
    DELAYS: (DELAYS_FILE,),
    CONFORMANCE: (CONFORMANCE_FILE,),
}
"""Part of what is told → its files below `results/analyze/<flight>`."""


@dataclass(frozen=True)
class Asked:
    """What all that is told of a flight follows from, beside the flight.

    Attributes
    ----------
    present : values of the present set; None where no delays are asked for
    missions : files of the missions that it is compared with
    code : part, a key of `FILES` → a figure for the state of the sources that make it
    """

    present: Mapping[str, float] | None
    missions: Sequence[AnyPath] = ()
    replay: ReplaySettings = IN_USE
    health: HealthSettings = OF_HEALTH
    conformance: ConformanceSettings = OF_CONFORMANCE
    code: Mapping[str, str] = field(default_factory=dict)

    @property
    def parts(self) -> tuple[str, ...]:
        """Those that are asked for."""
        return tuple(one for one in FILES if one != DELAYS or self.present is not None)


def tell_flight(flight_folder: AnyPath, output_folder: AnyPath, asked: Asked) -> tuple[str, ...]:
    """Write what is told of a saved flight, as far as its files do not stand as they were made from just this.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_folder : `results/analyze/<flight>`

    Returns
    -------
    The parts that were made

    Raises
    ------
    UserError
        The saved flight or a mission is missing, damaged or wrong.
    """
    told = _Told(Path(flight_folder), Path(output_folder), asked)
    made = told.outdated(DIAGNOSIS, DELAYS)
    if DIAGNOSIS in made:
        present = asked.present if DELAYS in made else None
        diagnose_flight(flight_folder, output_folder, replay=asked.replay, health=asked.health, present=present)
    elif made and asked.present is not None:
        estimate_delays(flight_folder, output_folder, asked.present, replay=asked.replay)
    # the track is the diagnosis's
    if compared := told.outdated(CONFORMANCE):
        write_conformance(
            flight_folder,
            told.folder / TRACK_FILE,
            asked.missions,
            told.folder / CONFORMANCE_FILE,
            asked.conformance,
        )
    told.record([*made, *compared])
    return (*made, *compared)


class _Told:
    """Which parts are out of date."""

    def __init__(self, flight_folder: Path, folder: Path, asked: Asked) -> None:
        self.folder, self._asked = folder, asked
        self._metadata = flight_folder / METADATA_FILE
        self._ledger = Ledger(folder / LEDGER_FILE)

    def outdated(self, *parts: str) -> list[str]:
        wanted = (one for one in parts if one in self._asked.parts)
        return [one for one in wanted if not self._ledger.is_current(one, self._key(one), self._files(one))]

    def record(self, parts: Iterable[str]) -> None:
        self._ledger.record_all({part: (self._key(part), self._files(part)) for part in parts})

    def _files(self, part: str) -> list[Path]:
        return [self.folder / name for name in FILES[part]]

    def _key(self, part: str) -> str:
        asked = self._asked
        follows: dict[str, list[Any]] = {
            DIAGNOSIS: [asdict(asked.replay), asdict(asked.health)],
            DELAYS: [asdict(asked.replay), None if asked.present is None else dict(asked.present)],
            CONFORMANCE: [asdict(asked.conformance)],
        }
        if part == CONFORMANCE:
            files = (self.folder / TRACK_FILE, *asked.missions)
            follows[part] += [sha256_of(one) if Path(one).exists() else None for one in files]
        # the checksum of the log and the verdict stand in it
        return key_of([sha256_of(self._metadata), asked.code.get(part), follows[part]])
