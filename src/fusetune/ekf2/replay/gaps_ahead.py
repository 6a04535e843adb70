"""The gaps of a replay, in the order in which its course comes to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.course import Course, GapRows, PlannedGap
from fusetune.ekf2.replay.results import Gap, GapResult
from fusetune.ekf2.schedule.taking_actions import SENSOR_NAMES
from fusetune.px4.aid_sources import WITHHOLDABLE


class GapsAhead:
    """Gaps by the updates of a course, and what was found in them.

    A gap is run through from within the compiled loop. One within which the log changes a parameter, or hands over to
    another instance, is run through apart from it.

    Parameters
    ----------
    first_run : of the course; a gap that begins before is left out
    """

    def __init__(self, course: Course, gaps: Sequence[Gap], first_run: int) -> None:
        self._course, self._gaps = course, gaps
        until, times = course.schedule.updates_until, np.ascontiguousarray(course.inputs.arrays.imu["time_us"])
        edges = {until(run) for run, _ in (*course.changes, *course.handovers)}
        self._found: dict[int, GapRows] = {}
        self._apart: dict[int, list[tuple[int, int]]] = {}
        planned = []
        for number, gap in enumerate(gaps):
            start, stop = (int(run) for run in np.searchsorted(times, (gap.start, gap.stop)))
            first, last = until(start), until(stop)
            if start < first_run or first >= last:
                continue
            if any(first < edge < last for edge in edges):
                self._apart.setdefault(start, []).append((number, stop))
            else:
                planned.append((number, _planned(gap, first, last)))
        planned.sort(key=lambda one: one[1].first_update)
        self._planned = planned
        self._starts = [one.first_update for _, one in planned]

    @property
    def cuts(self) -> list[int]:
        """Runs at which the course has to stop for a gap apart."""
        return list(self._apart)

    def go_apart(self, run: int) -> None:
        """Run through the gaps that begin at a run and are not for the compiled loop."""
        for number, stop in self._apart.get(run, ()):
            gap = self._gaps[number]
            self._found[number] = self._course.gap_apart(_planned(gap, 0, 0), run, stop)

    def within(self, start: int, stop: int) -> tuple[list[int], list[PlannedGap]]:
        """Numbers of the gaps that begin at an update of some runs, and the gaps."""
        until = self._course.schedule.updates_until
        first, last = np.searchsorted(self._starts, (until(start), until(stop)))
        here = self._planned[first:last]
        return [number for number, _ in here], [one for _, one in here]

    def take(self, numbers: Sequence[int], found: Sequence[GapRows]) -> None:
        """Keep what was found in gaps."""
        self._found.update(zip(numbers, found, strict=True))

    def results(self) -> tuple[GapResult, ...]:
        """Of every gap for which the filter had started."""
        results = []
        for number, gap in enumerate(self._gaps):
            rows = self._found.get(number)
            if rows is not None and len(rows.local_position):
                results.append(GapResult(gap, rows.start_us, rows.innovations, rows.local_position[[0, -1]]))
        return tuple(results)


def _planned(gap: Gap, first: int, last: int) -> PlannedGap:
    sources = sum(1 << AID_SOURCE_NAMES.index(name) for name in WITHHOLDABLE[gap.sensor])
    return PlannedGap(first, last, SENSOR_NAMES.index(gap.sensor), sources)
