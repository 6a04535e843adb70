"""Replays of the parameters that flew against the log, and how far each is from what the vehicle did."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusetune.analyze.flight.intervals import Cut, Interval, subtract
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.trust.as_flown_figures import AsFlownFigures, as_flown_figures, compared_rows
from fusetune.analyze.trust.settings import FALLING, TrustSettings
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.aid_sources import HORIZONTAL_AIDING
from fusetune.px4.flight import Flight
from fusetune.storage.freed_memory import give_back_freed_memory

COLD_WARM_UP_US = 10_000_000


def distance(figures: AsFlownFigures, settings: TrustSettings) -> float:
    """How far a replay is from the vehicle: mean of the figures, each as a share of the limit of grade B."""
    shares = []
    if figures.innovation_factor is not None:
        shares.append(math.log(figures.innovation_factor) / math.log(settings.innovation_factor[1]))
    for name in ("velocity_m_s", "heading_deg", "height_m", "vertical_velocity_m_s"):
        if getattr(figures, name) is not None:
            shares.append(getattr(figures, name) / getattr(settings, name)[1])
    for name in FALLING:
        if getattr(figures, name) is not None:
            shares.append((1.0 - getattr(figures, name)) / (1.0 - getattr(settings, name)[1]))
    return float(np.mean(shares)) if shares else math.nan


class AsFlownReplay(NamedTuple):
    """A replay of the parameters that flew, of which `as_flown_figures.compared_rows` were kept."""

    result: ReplayResult
    measured: np.ndarray
    """Whether the sample of each innovation stands in the log."""


class AsFlownComparison:
    """Replays of the parameters that flew against the log, all over the same part of the flight."""

    def __init__(self, flight: Flight, settings: TrustSettings):
        self.flight, self.settings = flight, settings
        self.onboard = onboard_samples(flight)
        self.intervals: tuple[Interval, ...] | None = None
        self._done: list[tuple[PreparedFlight, AsFlownFigures]] = []

    def figures(self, prepared: PreparedFlight, done: AsFlownReplay | None = None) -> AsFlownFigures:
        """Figures of one replay; the first one, which is the one in use, decides which part is compared.

        Parameters
        ----------
        done : the replay, where it has been made already
        """
        for other, figures in self._done:
            if _is_same_course(prepared, other):
                return figures
        give_back_freed_memory()
        result, measured = done or prepared.replay(prepared.parameters({}), keep=compared_rows(self.onboard))
        if self.intervals is None:
            self.intervals = self._compared(result)
        replayed = prepared.replayed.release
        figures = as_flown_figures(result, measured, self.flight, self.intervals, self.onboard, replayed)
        # other samples than those in use are not worth their memory
        if not self._done or prepared.inputs is self._done[0][0].inputs:
            self._done.append((prepared, figures))
        return figures

    def distance(self, prepared: PreparedFlight) -> float:
        """How far one replay is from the vehicle."""
        return distance(self.figures(prepared), self.settings)

    def _compared(self, result: ReplayResult) -> tuple[Interval, ...]:
        settle_us = round(self.settings.settle_s * 1e6)
        if result.warm_start_us is not None:
            begin = result.warm_start_us + settle_us
        else:
            sources = [AID_SOURCE_NAMES.index(name) for name in HORIZONTAL_AIDING if name in AID_SOURCE_NAMES]
            fused = result.innovations["fused"] & np.isin(result.innovations["source"], sources)
            # a filter without horizontal aid settles from its start
            times = result.innovations["timestamp_sample"][fused] if fused.any() else result.states["timestamp_sample"]
            begin = int(times.min(initial=2**62)) + settle_us + COLD_WARM_UP_US
        return subtract(airborne_intervals(self.flight, {}), [Cut(-(2**62), begin, "warm-up")])


def _is_same_course(one: PreparedFlight, other: PreparedFlight) -> bool:
    """Whether two prepared flights give the same replay, as where the one in use starts from nothing anyway."""
    same = ((one.inputs, other.inputs), (one.start.state, other.start.state), (one.handovers, other.handovers))
    return one.release == other.release and all(left is right for left, right in same)
