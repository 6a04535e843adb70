"""What a metric declares of itself beside the function that gives it, and what metrics of innovations are made of.

The long table of figures, the tables of windows and of the ground, and the list in docs/metrics.md follow from the
declarations; none of them names a metric.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Literal, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Given = TypeVar("Given")
Made = TypeVar("Made")

SOURCE_UNIT = "unit of the source"
"""The unit of a figure that has that of the innovations themselves, or of the error of a quantity."""

Better = Literal["lower", "higher", "nearer to 0", "nearer to the number of axes", ""]


@dataclass(frozen=True)
class Bounds:
    """A figure with its two-sided bounds; all of the same shape."""

    value: Array
    lower: Array
    upper: Array


@dataclass(frozen=True)
class Metric(Generic[Given]):
    """One metric.

    Attributes
    ----------
    name : in the tables
    unit : `"1"` for a pure number
    words : what it is
    function : of what the family of metrics is given, see where the family is gathered
    better : which of two values speaks for a set; empty where neither does
    used : packages that read it from the table, beside people
    """

    name: str
    unit: str
    words: str
    function: Callable[[Given], Any]
    better: Better = ""
    used: tuple[str, ...] = ()


@dataclass(frozen=True)
class Innovations:
    """Innovations of one axis or more of a source that share their samples: arrays (D, S, N), axes, sets, samples.

    Attributes
    ----------
    winsor_limits : gives those of the axes, (D,), each one figure or (S, 1), see
        `fusetune.analyze.metrics.likelihood.winsor_limit`
    confidence : of intervals
    of_group : whether they stand for a group of axes, which may be one alone
    """

    innovation: Array
    innovation_variance: Array
    test_ratio: Array
    rejected: npt.NDArray[np.bool_]
    winsor_limits: Callable[[], Sequence[float | Array]]
    confidence: float = 0.95
    of_group: bool = False
    _made: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def dimension(self) -> int:
        return self.innovation.shape[0]

    @property
    def samples(self) -> int:
        return self.innovation.shape[-1]

    def once(self, function: Callable[[Innovations], Made]) -> Made:
        """What a function gives of these innovations; several metrics rest on it and it is made for the first alone."""
        if function not in self._made:
            self._made[function] = function(self)
        made: Made = self._made[function]
        return made


def unchanged(values: Array) -> Array:
    """The mean itself."""
    return values


class InWindow(NamedTuple):
    """A metric of a window of some seconds.

    Attributes
    ----------
    worst : name of the largest figure of any window
    score : of each sample, (S, N)
    of_mean : makes the figure from the mean of the scores
    """

    worst: str
    score: Callable[[Innovations], npt.NDArray[Any]]
    of_mean: Callable[[Array], Array] = unchanged


@dataclass(frozen=True)
class InnovationMetric(Metric[Innovations]):
    """A metric of innovations: (S,) values, or `Bounds` of them.

    Attributes
    ----------
    of_groups : whether it is given for groups of axes as well
    samples : number of samples behind it, (S,), where these are not all
    window : what makes it of windows, where that is done
    on_ground : whether it is given for the time on the ground as well, with `ground_` before its name
    label : in a legend
    """

    of_groups: bool = True
    samples: Callable[[Innovations], Array] | None = None
    window: InWindow | None = None
    on_ground: bool = False
    label: str = ""
