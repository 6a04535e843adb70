"""A flight on which sets are tried, thousands of them: replayed and compared in memory, no more than is asked for.

What is compared follows from a *base* set alone: the part of the flight that is scored, its samples and gaps, the
limits beyond which errors are clipped, the smoothed velocity, and how white the sources are. So the figures of a set
do not depend on which others are tried, and none can hide an error: `fusetune.analyze.scoring.charges` says what
counts where it has nothing of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.sensor_delays import velocity_place_of
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.metrics.likelihood import winsorised
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, PreparedFlight, prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.scoring.filter_events import filter_events
from fusetune.analyze.scoring.measurement_alignment import counted_samples
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS, scored_flight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.smoothed_scores import velocity_differences
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.withheld_scores import counted_gaps
from fusetune.analyze.scoring.yardstick import Yardstick
from fusetune.analyze.trials.tried_set import ONE_STEP, SMOOTHED, WITHHELD, Column, Rejections, Sums, TriedSet
from fusetune.ekf2.replay.recording import SCORING
from fusetune.px4.aid_sources import AID_SOURCES, MEASURED_SOURCES, WITHHOLDABLE
from fusetune.save.flight_folder import load_flight
from fusetune.storage.files import AnyPath

Array = npt.NDArray[np.float64]

BASE, TRIED = "base", "tried"

TRIED_TOPICS = (*dict.fromkeys((*REPLAY_TOPICS, *SCORE_TOPICS)),)
"""What is read of a saved flight."""


@dataclass(frozen=True)
class TrialSettings:
    """What is compared.

    Attributes
    ----------
    sources : whose innovations count
    withheld_sources : that are predicted while their sensor is withheld; other sensors are not withheld at all
    """

    replay: ReplaySettings
    scoring: ScoringSettings
    sources: tuple[str, ...]
    withheld_sources: tuple[str, ...]

    @property
    def replayed(self) -> ReplaySettings:
        """How flights are replayed: without gaps that nothing is made of."""
        given = self.replay.withholding
        if given is None:
            return self.replay
        asked = {sensor for sensor, sources in WITHHOLDABLE.items() if {*sources} & {*self.withheld_sources}}
        lengths = {f"{sensor}_s": given.length_s(sensor) if sensor in asked else 0.0 for sensor in WITHHOLDABLE}
        return replace(self.replay, withholding=replace(given, **lengths))  # type: ignore[arg-type]


def prepare_trials(flight_folder: AnyPath, settings: TrialSettings) -> PreparedFlight:
    """Prepare a saved flight, `results/save/<flight>`, for any number of sets and bases."""
    return prepare_flight(load_flight(flight_folder, topics=TRIED_TOPICS), settings.replayed)


class TriedFlight:
    """A flight with a base set, on which other sets are tried.

    Parameters
    ----------
    prepared : from `prepare_trials`
    base : parameters in which the base set differs from the log's own
    """

    def __init__(self, prepared: PreparedFlight, base: Mapping[str, float], settings: TrialSettings) -> None:
        self.name = prepared.flight.name
        self._prepared, self._settings = prepared, settings
        self._base = replay_set(prepared, BASE, base)
        self._yardstick = Yardstick(scored_flight(prepared.flight, settings.scoring), self._base, settings.scoring)
        self.reason = self._yardstick.window.reason
        """Why nothing can be compared on the flight; empty where it can."""

    @cached_property
    def base_set(self) -> TriedSet:
        """The base set, compared like any other."""
        return self._compared(replace(self._base, name=TRIED))

    @cached_property
    def whiteness(self) -> dict[str, float]:
        """How white the error of each source is as the base sees it, 0 … 1: the mean over its axes."""
        shares: dict[str, list[float]] = {}
        for (source, _), one in self._yardstick.whiteness.items():
            if np.isfinite(one.white_share):
                shares.setdefault(source, []).append(one.white_share)
        return {source: float(np.mean(values)) for source, values in shares.items()}

    @cached_property
    def place(self) -> VelocityPlace | None:
        """Delay and place of the GNSS antenna; None where the flight does not tell them."""
        return velocity_place_of(self._base, "gnss", self._yardstick.airborne)

    def try_set(self, overrides: Mapping[str, float]) -> TriedSet:
        """Replay a set and compare it; parameters in which it differs from the log's own."""
        return self._compared(replay_set(self._prepared, TRIED, overrides, SCORING))

    def _compared(self, record: ReplayedSet) -> TriedSet:
        window = self._yardstick.window_of(record)
        if not window.intervals:
            return TriedSet(reason=window.reason)
        if record.name in window.excluded:
            return TriedSet(reason=window.excluded[record.name])
        events = filter_events(record, self._yardstick.flying(record))
        return TriedSet(
            sums=dict(chain(self._one_step(record, window), self._withheld(record, window), self._smoothed(record))),
            flight_s=events.flight_s,
            significant_resets=events.significant_resets,
            timeouts=events.total_timeouts,
            fault_s=events.fault_s,
            rejections=dict(self._rejections(record, window)),
        )

    def _one_step(self, record: ReplayedSet, window: ScoringWindow) -> Iterable[tuple[Column, Sums]]:
        masks, most = self._yardstick.masks, self._settings.scoring.max_lacking_percent
        for source in self._settings.sources:
            for axis in range(AID_SOURCES[source].axes):
                mask = masks.get((source, axis))
                found = None if mask is None else counted_samples(mask, record, window, most).samples
                if mask is not None and found is not None:
                    clipped = winsorised(found.innovation, mask.winsor_limit)
                    yield Column(ONE_STEP, source, axis), _sums(clipped, found.innovation_variance)

    def _withheld(self, record: ReplayedSet, window: ScoringWindow) -> Iterable[tuple[Column, Sums]]:
        most = self._settings.scoring.max_lacking_percent
        masks = [one for one in self._yardstick.gaps if one.source in self._settings.withheld_sources]
        for found in counted_gaps(masks, record, window, most):
            if found.is_compared:
                mask = found.mask
                clipped = winsorised(found.error, mask.winsor_limit)
                yield Column(WITHHELD, mask.source, mask.axis, mask.horizon_s), _sums(clipped)

    def _smoothed(self, record: ReplayedSet) -> Iterable[tuple[Column, Sums]]:
        mask = self._yardstick.smoothed
        if mask is None:
            return
        differences = velocity_differences(mask.reference, record.states())
        for axis, limit in enumerate(mask.winsor_limits.tolist()):
            yield Column(SMOOTHED, mask.reference.source, axis), _sums(winsorised(differences[:, axis], limit))

    def _rejections(self, record: ReplayedSet, window: ScoringWindow) -> Iterator[tuple[tuple[str, int], Rejections]]:
        """Of the samples in the scored part, as every set that fuses the source has them."""
        for source, axis in record.samples:
            if source in MEASURED_SOURCES and not MEASURED_SOURCES[source].every_update:
                samples = record.samples[source, axis]
                scored = window.contains(samples.timestamp_sample)
                yield (source, axis), Rejections(int(samples.rejected[scored].sum()), int(scored.sum()))


def _sums(error: Array, variance: Array | None = None) -> Sums:
    if variance is None:
        return Sums(float(error.size), float(np.sum(np.square(error))), 0.0)
    return Sums(float(error.size), float(np.sum(np.square(error) / variance)), float(np.sum(np.log(variance))))
