"""What the diagnosis and the tuners say of each flight; kept, so that only what changed is asked again."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.save import load_flight
from fusetune.storage.digest import source_digest
from fusetune.storage.files import atomic_path

from .cases import Case
from .flights import FAULT_FILE, folder_of

ALARMS = ("warning", "fail")


@dataclass(frozen=True)
class Named:
    """A cause that was named."""

    id: str
    severity: str
    confidence: float
    explains: float
    values: Mapping[str, float]


@dataclass(frozen=True)
class Told:
    """A value that a tuner told, with its interval."""

    effect: str
    name: str
    unit: str
    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Verdict:
    """What was said of one flight, beside what is true of it.

    Attributes
    ----------
    fault : what `fault.json` holds
    named : causes in their order
    told : values of the tuners; `refused` names those that told none
    cpu_s : of the diagnosis alone
    problem : why there is no answer, where there is none
    """

    group: str
    number: int
    fault: Mapping[str, Any]
    named: tuple[Named, ...]
    told: tuple[Told, ...]
    refused: tuple[str, ...]
    cpu_s: float
    problem: str = ""

    @property
    def injected(self) -> tuple[str, ...]:
        """Kinds that were injected."""
        return tuple(one["kind"] for one in self.fault["injected"])

    @property
    def is_visible(self) -> bool:
        """Whether all that was injected can be seen."""
        return bool(self.fault["visible"])

    @property
    def alarms(self) -> tuple[Named, ...]:
        """Causes that are more than a note."""
        return tuple(one for one in self.named if one.severity in ALARMS)


def verdicts(flights: Path, kept: Path, cases: Sequence[Case], *, causes_only: bool = False) -> Iterator[Verdict]:
    """What is said of each case, in order; asked where it is not kept from the same sources.

    Parameters
    ----------
    causes_only : whether the tuners, which take most of the time, are not asked
    """
    sources = source_digest("px4", "ekf2", "analyze")
    _warm_up()
    for case in cases:
        folder = folder_of(flights, case)
        fault = json.loads((folder / FAULT_FILE).read_text(encoding="utf-8"))
        asked = [sources, fault, "causes"] if causes_only else [sources, fault]
        key = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()
        file = kept / case.group / f"{case.number:02}.json"
        if not _is_kept(file, key):
            verdict = _ask(case, folder / case.name, fault, causes_only)
            file.parent.mkdir(parents=True, exist_ok=True)
            with atomic_path(file) as temporary:
                temporary.write_text(json.dumps({"key": key, "verdict": asdict(verdict)}, indent=1), encoding="utf-8")
        yield _read(file)


def kept_verdicts(kept: Path) -> Iterator[Verdict]:
    """What was said of every flight of a study, as it is kept."""
    for file in sorted(kept.glob("*/*.json")):
        yield _read(file)


def _warm_up() -> None:
    """Imports are no part of what a flight costs."""
    import fusetune.analyze.diagnosis.diagnose
    import fusetune.analyze.effects.all_effects  # noqa: F401


def _is_kept(file: Path, key: str) -> bool:
    return file.is_file() and json.loads(file.read_text(encoding="utf-8"))["key"] == key


def _read(file: Path) -> Verdict:
    document = json.loads(file.read_text(encoding="utf-8"))["verdict"]
    return Verdict(
        **document
        | {
            "named": tuple(Named(**one) for one in document["named"]),
            "told": tuple(Told(**one) for one in document["told"]),
            "refused": tuple(document["refused"]),
        }
    )


def _ask(case: Case, saved: Path, fault: Mapping[str, Any], causes_only: bool) -> Verdict:
    from fusetune.analyze.diagnosis.diagnose import diagnose
    from fusetune.analyze.diagnosis.diagnosed_logs import AS_FLOWN
    from fusetune.analyze.effects.all_effects import all_effects

    flight = load_flight(saved)
    start = time.process_time()
    try:
        observed = ObservedFlight(flight, AS_FLOWN)
        found = diagnose(observed)
        cpu_s = time.process_time() - start
        effects = () if causes_only else all_effects(observed)
    except Exception as error:  # a flight that breaks the diagnosis counts as one that it does not name
        return Verdict(case.group, case.number, fault, (), (), (), 0.0, f"{type(error).__name__}: {error}")
    named = tuple(Named(one.id, one.severity, one.confidence, one.explains, dict(one.values)) for one in found)
    told = tuple(
        Told(effect.id, one.name, one.unit, one.value, one.lower, one.upper)
        for effect in effects
        for one in effect.estimates
    )
    refused = tuple(effect.id for effect in effects if not effect.estimates)
    return Verdict(case.group, case.number, fault, named, told, refused, cpu_s)
