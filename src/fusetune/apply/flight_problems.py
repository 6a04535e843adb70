"""What is wrong with the vehicle, from the diagnoses of its flights: told with the decision, for it may change it.

No noise parameter cures a loose IMU. What no parameter of EKF2 mends is to be mended before sets are compared.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from fusetune.finding import Finding, Severity
from fusetune.storage.documents import read_as
from fusetune.storage.files import AnyPath

SURE = 0.6
"""Diagnoses that are less sure are on the flight's page, and not told here."""

OF_ALL_FLIGHTS = ("gnss_delay", "gnss_lever_arm", "noise_claim")
"""What a single flight says of these is weaker than what the decision makes of all flights, and could contradict it."""

_WORSE: Mapping[str, int] = {"warning": 1, "fail": 2}
_OF_EKF2 = "EKF2_"


@dataclass(frozen=True)
class FlightDiagnoses:
    """What `diagnosis.json` holds of one flight: diagnoses as `Diagnosis.document` makes them."""

    flight: str
    diagnoses: tuple[Mapping[str, Any], ...]


def read_diagnoses(file: AnyPath) -> FlightDiagnoses:
    """Read `results/analyze/<flight>/diagnosis.json`; `UserError` where that cannot be."""
    return read_as(file, lambda found: FlightDiagnoses(found["flight"], tuple(found["diagnoses"])), "a diagnosis")


def problem_findings(flights: Sequence[FlightDiagnoses]) -> tuple[Finding, ...]:
    """One finding for each cause, the worst and most frequent first."""
    by_cause: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}
    for one in flights:
        for found in one.diagnoses:
            if found["severity"] in _WORSE and found["confidence"] >= SURE and found["id"] not in OF_ALL_FLIGHTS:
                by_cause.setdefault(found["id"], []).append((one.flight, found))
    findings = [_finding(cause, found, len(flights)) for cause, found in by_cause.items()]
    return tuple(sorted(findings, key=lambda one: (-_WORSE[one.severity], -(one.figure or 0.0), one.id)))


def _finding(cause: str, found: Sequence[tuple[str, Mapping[str, Any]]], number: int) -> Finding:
    worst = max((one for _, one in found), key=lambda one: (_WORSE[one["severity"]], one["confidence"]))
    names = [flight for flight, _ in found]
    where = f"on {len(names)} of {number} flights" if number > 1 else f"on {names[0]}"
    return Finding(
        id=f"diagnosis.{cause}",
        severity=cast(Severity, worst["severity"]),
        found=f"{worst['cause']} ({where})",
        remedy=worst["remedy"],
        figure=float(len(names)),
        unit="flights",
        evidence={
            "flights": ", ".join(names),
            "confidence": worst["confidence"],
            "mended_by_parameter": _is_mended_by_parameter(worst),
        },
    )


def _is_mended_by_parameter(diagnosis: Mapping[str, Any]) -> bool:
    return any(name.startswith(_OF_EKF2) for name in diagnosis["values"])


def problem_sentence(findings: Sequence[Finding]) -> str:
    """What to mend before tuning; empty where nothing is, or where parameters mend it."""
    first = [one for one in findings if not one.evidence.get("mended_by_parameter")]
    if not first:
        return ""
    told = "; ".join(_within_a_sentence(one.found) for one in first[:3])
    more = f"; and {len(first) - 3} more" if len(first) > 3 else ""
    return f"Mend this first, and tune on flights after it, for it may change the choice: {told}{more}."


def _within_a_sentence(words: str) -> str:
    """With a small first letter, but for names such as GNSS and IMU."""
    first = words.split(maxsplit=1)[0]
    return words if len(first) > 1 and first.isupper() else f"{words[0].lower()}{words[1:]}"
