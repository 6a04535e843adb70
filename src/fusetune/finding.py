"""What a room found out about a flight, in the one form that all rooms share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal

Severity = Literal["does-not-apply", "pass", "note", "warning", "fail"]
"""How much a finding matters, from nothing to all.

does-not-apply : the flight has nothing of the kind that was asked for
pass : as it should be
note : worth knowing, and taken care of: a part that is not scored, samples that were made up for
warning : lessens what the flight can tell
fail : with it the flight cannot be used
"""

Evidence = Mapping[str, bool | int | float | str]
"""Names → values that a finding rests on; a name that has a unit ends with it."""


@dataclass(frozen=True)
class Finding:
    """One thing that was found out about a flight.

    Attributes
    ----------
    id : what was asked or came up; the same for the same thing on every flight, never shown without `found`
    found : in plain words
    remedy : what the pilot can do about it; a warning or a failure of a verdict has one
    figure, threshold : what was measured and from where on it matters, both in `unit`
    start_us, stop_us : part of the flight that it is about, µs since boot, half-open; None where it is about all of it
    evidence : what else it rests on
    """

    id: str
    severity: Severity
    found: str
    remedy: str = ""
    figure: float | None = None
    threshold: float | None = None
    unit: str = ""
    start_us: int | None = None
    stop_us: int | None = None
    evidence: Evidence = field(default_factory=dict, hash=False)

    @property
    def in_words(self) -> str:
        """What was found, with the remedy in brackets."""
        return f"{self.found} ({self.remedy})" if self.remedy else self.found

    def document(self) -> dict[str, Any]:
        """The finding as a JSON object, as all result files hold findings."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Finding:
        """Read what `document` made, or a row of a table that has some of its columns."""
        return cls(**{one.name: document[one.name] for one in fields(cls) if one.name in document})


def documents(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Findings as JSON objects."""
    return [finding.document() for finding in findings]


def from_documents(entries: Iterable[Mapping[str, Any]] | None) -> tuple[Finding, ...]:
    """Read findings from a result file or from a column of a table; of none there are none."""
    return tuple(Finding.from_document(entry) for entry in (entries if entries is not None else ()))


def of_severity(findings: Iterable[Finding], severity: Severity) -> tuple[Finding, ...]:
    """Those of one severity, in their order."""
    return tuple(finding for finding in findings if finding.severity == severity)
