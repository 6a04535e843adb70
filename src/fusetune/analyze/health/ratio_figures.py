"""The figures of a series of test ratios, the same whoever computed it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import at, span, worst_mean
from fusetune.analyze.health.settings import REJECTED_RATIO, Levels
from fusetune.analyze.health.subject import Subject
from fusetune.finding import Evidence


def ratio_rows(
    health: JudgedHealth,
    subject: Subject,
    time: npt.NDArray[np.int64],
    ratio: npt.NDArray[np.float64],
    within: Sequence[Interval],
    evidence: Evidence,
    *,
    judged: bool = True,
) -> Iterator[HealthRow]:
    """Shares above 0.5 and 1, mean, maximum and worst stretch.

    Parameters
    ----------
    time, ratio : (N,) µs and test ratios in the window, all finite; N > 0
    within : the window, µs
    judged : whether the levels count; without it the figures are only told
    """
    limits = health.limits
    order = np.argsort(time, kind="stable")
    time, ratio = time[order], ratio[order]
    judged = judged and ratio.size >= limits.fewest_samples
    raised, red = ratio > limits.raised_ratio, ratio > REJECTED_RATIO
    when = time[raised]
    yield subject.judged(
        "raised_share",
        f"test ratios above {limits.raised_ratio:g}:",
        float(np.mean(raised)),
        "",
        Levels(*limits.raised_share) if judged else Levels(np.inf),
        remedy="Find out what disturbs the sensor, or whether EKF2 is told too small a noise",
        evidence=evidence,
        when=span(when),
    )
    yield subject.told(
        "amber_share", f"test ratios in ({limits.raised_ratio:g}, 1]:", float(np.mean(raised & ~red)), evidence=evidence
    )
    yield subject.told("red_share", "test ratios above 1:", float(np.mean(red)), evidence=evidence)
    yield subject.told("mean_ratio", "mean test ratio", float(np.mean(ratio)), evidence=evidence)
    peak = int(np.argmax(ratio))
    yield subject.told("max_ratio", "largest test ratio", float(ratio[peak]), evidence=evidence, when=at(time[peak]))
    worst = worst_mean(time, ratio, limits.worst_window_s, within)
    words = f"mean test ratio of the worst {limits.worst_window_s:g} s"
    yield subject.told("worst_ratio", words, worst.value, evidence=evidence, when=worst.when)
