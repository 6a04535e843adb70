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

FEW_SAMPLES = 50_000
"""Of so few what metrics share is kept for the next that asks."""

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
    whole, places : where they are of a group: all axes of the source, each by itself, of one set after the other, and
        places of those of the group among the axes
    """

    innovation: Array
    innovation_variance: Array
    test_ratio: Array
    rejected: npt.NDArray[np.bool_]
    winsor_limits: Callable[[], Sequence[float | Array]]
    confidence: float = 0.95
    of_group: bool = False
    whole: Innovations | None = None
    places: slice | Sequence[int] = ()
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

    def once_if_few(self, function: Callable[[Innovations], Made]) -> Made:
        """The same of what is as large as the innovations: of many samples it is made each time, and not kept."""
        return self.once(function) if self.samples <= FEW_SAMPLES else function(self)

    def by_axis(self, function: Callable[[Innovations], npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """What a function gives of each axis by itself, (D, S, …): made once for all groups that the axis is in.

        Parameters
        ----------
        function : makes (D, S, …) of innovations; of each axis what it makes of that axis alone
        """
        if self.samples > FEW_SAMPLES:
            # not of all axes at once, which takes the more memory
            each = [function(self._alone(axis)) for axis in range(self.dimension)]
            return each[0] if len(each) == 1 else np.concatenate(each)
        return self.once(function) if self.whole is None else self._of_group(self.whole.once(function)[0])

    def _of_group(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The axes of the group, (D, S, …), out of those of the source, of one set after the other."""
        sets = self.innovation.shape[1]
        return values.reshape(sets, -1, *values.shape[1:])[:, self.places].swapaxes(0, 1)

    def _alone(self, axis: int) -> Innovations:
        if self.dimension == 1:
            return self
        rows = slice(axis, axis + 1)
        return Innovations(
            self.innovation[rows],
            self.innovation_variance[rows],
            self.test_ratio[rows],
            self.rejected[rows],
            lambda: [self.winsor_limits()[axis]],
            self.confidence,
            self.of_group,
        )

    @classmethod
    def of_places(cls, whole: Innovations, sets: int, places: Sequence[int], limits: Sequence[float]) -> Innovations:
        """A group of axes.

        Parameters
        ----------
        whole : all axes of the source, each by itself, (1, S A, N)
        places : of those of the group among the A axes
        limits : theirs
        """
        follow = [*places] == [*range(places[0], places[-1] + 1)]
        taken: slice | Sequence[int] = slice(places[0], places[-1] + 1) if follow else places

        def own(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return values[0].reshape(sets, -1, values.shape[-1])[:, taken].swapaxes(0, 1)

        return cls(
            own(whole.innovation),
            own(whole.innovation_variance),
            own(whole.test_ratio),
            own(whole.rejected),
            lambda: limits,
            whole.confidence,
            of_group=True,
            whole=whole,
            places=taken,
        )


def mean_of_samples(values: Array) -> Array:
    """Mean over the last axis, (..., N) → (...): `numpy.mean` to the bit, in half its time where samples are few."""
    return np.asarray(np.add.reduce(values, axis=-1) / values.shape[-1])


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
