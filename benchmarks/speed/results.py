"""What sections found on revisions, over repeats."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from benchmarks.speed.quantities import Quantity


@dataclass
class Samples:
    """One quantity on one revision: a value of each repeat, and the calibration loop of that repeat."""

    values: list[float] = field(default_factory=list)
    loops_s: list[float] = field(default_factory=list)

    @property
    def value(self) -> float:
        """The median."""
        return statistics.median(self.values)

    @property
    def spread(self) -> float:
        """Largest less smallest, as a share of the median."""
        return (max(self.values) - min(self.values)) / abs(self.value) if self.value else 0.0

    def calibrated(self, quantity: Quantity) -> list[float]:
        """The values as multiples of the loop."""
        return [quantity.calibrated(*pair) for pair in zip(self.values, self.loops_s, strict=True)]


@dataclass
class SectionResults:
    """What a section found on one revision."""

    quantities: Mapping[str, Quantity]
    samples: dict[str, Samples] = field(default_factory=dict)
    lacking: str = ""
    failed: str = ""

    def add(self, told: Mapping[str, Any]) -> None:
        """Take what one process printed (`inside`)."""
        self.lacking = self.lacking or told["lacking"]
        self.failed = self.failed or told["failed"]
        for name, value in told["values"].items():
            samples = self.samples.setdefault(name, Samples())
            samples.values.append(value)
            samples.loops_s.append(told["loop_s"])

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "lacking": self.lacking,
            "failed": self.failed,
            "samples": {name: asdict(samples) for name, samples in self.samples.items()},
        }
