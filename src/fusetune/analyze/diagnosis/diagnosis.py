"""A cause that a flight shows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

SURE = ((0.9, "sure"), (0.7, "likely"), (0.0, "possible"))
"""From which confidence on what is said of a cause, in the terminal and on pages."""


@dataclass(frozen=True)
class Sign:
    """One thing seen that speaks for a cause.

    Attributes
    ----------
    words : what was seen, with the figure, plainly
    figure, usual, unit : what was measured, and up to where it is usual
    origin : who computed what it is made of
    """

    words: str
    figure: float
    usual: float
    unit: str = ""
    origin: Literal["vehicle", "replay"] = "vehicle"


@dataclass(frozen=True)
class Trial:
    """What a replay with the cause taken away showed; no sign, as it may speak for the cause, against it or not at all.

    Attributes
    ----------
    words : what was done and what came of it, plainly, with the figures before and after
    before, after : mean test ratio of the sources that the cause spoils
    outcome : `better` speaks for the cause, `worse` against it; `no better`, though there was something to mend; `tells
        nothing` where these sources are fine with the cause as well
    """

    words: str
    before: float
    after: float
    outcome: Literal["better", "no better", "worse", "tells nothing"]


@dataclass(frozen=True)
class Diagnosis:
    """A cause, what shows it, and what to do.

    Attributes
    ----------
    id : of the cause, one for each file of `fusetune.analyze.diagnosis.causes`; the same in every release of fusetune
    cause : in plain words, the answer first: `The GNSS antenna is 0.3 m from where PX4 is told`
    severity : note (worth knowing), warning (lessens what the filter can do), fail (do not fly like this)
    confidence : 0 … 1, how sure: of as many diagnoses with this confidence this share should be right
    explains : how much of what is wrong it explains, in the units of a test ratio's excess; the largest stands first
    start_us, stop_us : when, µs since boot, half-open
    signs : what shows it
    remedy : what to do, in the order in which to do it; parameters by name
    source : where the signs are known from
    values : values to set or measured, by name; names of measured ones end in their unit
    trial : what the replay without the cause showed; None where it was not tried
    """

    id: str
    cause: str
    severity: Literal["note", "warning", "fail"]
    confidence: float
    explains: float
    start_us: int
    stop_us: int
    signs: tuple[Sign, ...]
    remedy: str
    source: str
    values: Mapping[str, float] = field(default_factory=dict, hash=False)
    trial: Trial | None = None

    def document(self, start_of_log_us: int) -> dict[str, Any]:
        """As JSON holds it: times in seconds from the start of the log, null for figures that are none."""
        document = {
            "id": self.id,
            "cause": self.cause,
            "severity": self.severity,
            "confidence": self.confidence,
            "since_s": round((self.start_us - start_of_log_us) * 1e-6, 3),
            "until_s": round((self.stop_us - start_of_log_us) * 1e-6, 3),
            "evidence": [vars(one) for one in self.signs],
            "remedy": self.remedy,
            "values": dict(self.values),
            "source": self.source,
            "experiment": None if self.trial is None else vars(self.trial),
        }
        return {name: _as_json(value) for name, value in document.items()}


def how_sure(confidence: float) -> str:
    """A word for a confidence as it is told, in whole percent, so that 90 % is never two words."""
    return next(word for least, word in SURE if round(confidence, 2) >= least)


def _as_json(value: Any) -> Any:
    """Plain numbers; null for those that JSON does not have."""
    if isinstance(value, dict):
        return {name: _as_json(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_as_json(one) for one in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
