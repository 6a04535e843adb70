"""One row of the health table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from fusetune.finding import Finding

Origin = Literal["vehicle", "replay"]
"""Who computed what a figure is made of: the vehicle's own estimator and drivers, or the replay of its flight."""


@dataclass(frozen=True)
class HealthRow:
    """A figure with its limit, as a finding.

    Attributes
    ----------
    finding : id (`<subject>.<figure>`, as `gnss_vel.red_share`), severity, words, figure, threshold, unit, when;
        does-not-apply where the flight has nothing of the kind
    group : what it belongs to in the table: filter, aid source, sensor, GNSS quality …
    instance : of the estimator or sensor; None where there is but one or none
    origin : who computed what it is made of
    """

    finding: Finding
    group: str
    instance: int | None = None
    origin: Origin = "vehicle"

    def document(self) -> dict[str, Any]:
        """The row as a JSON object: the finding with group, instance and origin beside."""
        return self.finding.document() | {"group": self.group, "instance": self.instance, "origin": self.origin}
