"""What all replays of a flight share: made once, whatever is replayed, scored or graded."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.reconstruction import (
    RECONSTRUCTION_TOPICS,
    ReconstructedFlight,
    ReconstructionSettings,
    as_logged,
    measured_rows,
    reconstruct,
)
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings, StartSettings
from fusetune.analyze.replaying.start_choice import COLD, START_TOPICS, WARM, Start, choose_start
from fusetune.analyze.replaying.withheld_gaps import plan_gaps
from fusetune.ekf2.feed.inputs import EstimatorInputs, build_inputs
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.ekf2.releases.modelled import demand_modelled
from fusetune.ekf2.replay.recording import FULL, RecordArrays, Recording
from fusetune.ekf2.replay.replay import replay, replay_into
from fusetune.ekf2.replay.results import Gap, ReplayResult, ReplaySummary
from fusetune.errors import UserError
from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.logged_state import Handover, logged_handovers
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.parameters.ekf2_parameters import ParameterError
from fusetune.px4.releases import AUTO
from fusetune.save.replayed_release import ReplayedRelease, replayed_release

Summary = TypeVar("Summary", bound=ReplaySummary)

REPLAY_TOPICS = (*dict.fromkeys((*RECONSTRUCTION_TOPICS, *START_TOPICS)),)
"""What a replay reads of a saved flight."""

MOST_IN_MEMORY = 150_000
"""IMU samples of a flight, some ten minutes, up to which all that its replays share and record is kept in memory."""


@dataclass(frozen=True)
class PreparedFlight:
    """What the replays of all sets on one flight share: samples, start, and which samples were measured."""

    flight: Flight
    """As it was logged, in the layout of `fusetune.px4.layouts.release_layouts.canonical`."""
    inputs: EstimatorInputs
    reconstructed: ReconstructedFlight
    start: Start
    gaps: tuple[Gap, ...] = ()
    handovers: tuple[Handover, ...] = ()
    release: str = BASELINE
    """Whose estimator replays it."""
    asked_release: str = ""
    """As in `ReplaySettings`; empty where just this one is meant."""

    @cached_property
    def replayed(self) -> ReplayedRelease:
        """Whose estimator replays it, and why."""
        found = replayed_release(self.flight, self.asked_release or self.release)
        return found if found.name == self.release else replayed_release(self.flight, self.release)

    def parameters(self, overrides: Mapping[str, float], given: Mapping[str, float] | None = None) -> dict[str, float]:
        """A complete set: the log's own parameters, but for some; `given` counts before them, as in `complete`.

        Raises
        ------
        UserError
            The release whose estimator replays the flight has no such parameter, or no such value of it.
        """
        logged, flown = self.flight.parameters.initial, self.flight.release
        try:
            return complete(logged, overrides, flown, replayed=self.replayed.release, given=given or {})
        except ParameterError as error:
            told_of = f"{self.flight.name}, which {self.replayed.name}'s estimator replays: {error.name}"
            remedy = f"{error.remedy}; or let the estimator of v1.16 replay all flights (release: {BASELINE})"
            raise UserError(told_of, error.reason, remedy) from error

    def course_of(self, overrides: Mapping[str, float]) -> tuple[Any, ...]:
        """What the replay of a set follows from beside the flight: sets that have it in common have one replay.

        Returns
        -------
        The release whose estimator does it, its parameters, and which of their changes in flight are applied to it
        """
        params = self.parameters(overrides)
        changed = {change.name for _, change in self.inputs.parameter_changes}
        return (self.release, *sorted(params.items()), *sorted(changed - {*overrides}))

    def replay(
        self,
        params: Mapping[str, float],
        overridden: frozenset[str] = frozenset(),
        keep: Callable[[RecordArrays], RecordArrays] | None = None,
    ) -> tuple[ReplayResult, np.ndarray]:
        """Replay a complete set; the result, and for each innovation whether its sample was measured.

        `keep` as for `fusetune.ekf2.replay.replay`.
        """
        result = replay(self.inputs, params, overridden=overridden, keep=keep, **self._shared())
        return self._with_measured_gaps(result, params), self.measured(result.innovations, params, result)

    def replay_into(
        self,
        take: Callable[[RecordArrays], None],
        params: Mapping[str, float],
        overridden: frozenset[str] = frozenset(),
        recording: Recording = FULL,
    ) -> ReplaySummary:
        """Replay a complete set and hand on its rows as they come, see `fusetune.ekf2.replay.replay.replay_into`."""
        summary = replay_into(take, self.inputs, params, overridden=overridden, recording=recording, **self._shared())
        return self._with_measured_gaps(summary, params)

    def measured(self, innovations: np.ndarray, params: Mapping[str, float], of: ReplaySummary) -> np.ndarray:
        """For each innovation row of a replay whether its sample was measured."""
        return measured_rows(innovations, self.reconstructed, params, of.update_interval_us)

    def _shared(self) -> dict[str, Any]:
        return {
            "start": self.start.state,
            "gaps": self.gaps,
            "handovers": self.handovers,
            "release": self.release,
        }

    def _with_measured_gaps(self, summary: Summary, params: Mapping[str, float]) -> Summary:
        if not summary.gaps or not self.reconstructed.changed:
            return summary
        # told apart for all gaps at once
        ends = np.cumsum([len(gap.innovations) for gap in summary.gaps])
        measured = self.measured(np.concatenate([gap.innovations for gap in summary.gaps]), params, summary)
        gaps = tuple(
            dataclasses.replace(gap, innovations=gap.innovations[own])
            for gap, own in zip(summary.gaps, np.split(measured, ends[:-1]), strict=True)
        )
        return dataclasses.replace(summary, gaps=gaps)

    def with_stream(self, reconstructed: ReconstructedFlight) -> PreparedFlight:
        """The same flight, started alike, with another sensor stream."""
        return dataclasses.replace(self, inputs=build_inputs(reconstructed.flight), reconstructed=reconstructed)

    def as_replayed_by(self, release: str) -> PreparedFlight:
        """The same flight, to be replayed by another release's estimator; "auto" is the one that flew, or the nearest.

        Raises
        ------
        UserError
            The release is not modelled.
        """
        if release != AUTO:
            demand_modelled(release)
        chosen = replayed_release(self.flight, release).name
        return dataclasses.replace(self, release=chosen, asked_release=release)

    def with_flight(self, flight: Flight) -> PreparedFlight:
        """The same flight with other topics of its log which no replay reads."""
        return dataclasses.replace(self, flight=flight)

    def for_replays_alone(self) -> PreparedFlight:
        """The same flight without what of its log no replay reads once it is prepared."""
        reconstructed, sensors = self.reconstructed, {sensor.topics[0].name for sensor in SENSORS.values()}
        read = {
            key: table
            for key, table in reconstructed.flight.topics.items()
            if key[0] in reconstructed.measured and key[0] in sensors
        }
        reconstructed = dataclasses.replace(reconstructed, flight=reconstructed.flight.with_topics(read))
        return dataclasses.replace(self, flight=self.flight.with_topics({}), reconstructed=reconstructed)

    def without_schedules(self) -> PreparedFlight:
        """The same flight without what its replays have worked out so far and share: the next one works it out anew."""
        return dataclasses.replace(self, inputs=dataclasses.replace(self.inputs))

    @property
    def is_long(self) -> bool:
        """Whether what follows from it is too large to keep all in memory."""
        return len(self.inputs.arrays.imu) > MOST_IN_MEMORY

    @property
    def sets_at_once(self) -> int:
        """How many sets' replays take no more memory than one of a flight that is just not long."""
        return max(1, MOST_IN_MEMORY // max(1, len(self.inputs.arrays.imu)))

    def description(self, result: ReplaySummary) -> dict[str, Any]:
        """For the summary of a replay: whose it is, unless just v1.16's was asked for, its start, what was repaired."""
        warm = result.warm_start_us is not None
        release = {} if self.replayed.asked == BASELINE else {"release": self.replayed.document()}
        return release | {
            "start": {"mode": WARM if warm else COLD, "why": self.start.why, "time_us": result.warm_start_us},
            "reconstruction": [asdict(step) for step in self.reconstructed.steps],
            "handover_timestamps": [one.time_us for one in self.handovers],
        }


def prepare_flight(flight: Flight, settings: ReplaySettings = IN_USE) -> PreparedFlight:
    """Prepare a flight as it was logged.

    Parameters
    ----------
    flight : with `REPLAY_TOPICS` at least, in the layout of any release
    settings : what is done about the flight; by default all that the default configuration does
    """
    flight = canonical(flight)
    gaps = plan_gaps(flight, airborne_intervals(flight, {}), settings.withholding) if settings.withholding else ()
    return prepare(flight, settings.reconstruction, settings.start, gaps, settings.release)


def prepare(
    flight: Flight,
    reconstruction: ReconstructionSettings | None = None,
    start: StartSettings | None = None,
    gaps: Sequence[Gap] = (),
    release: str = BASELINE,
) -> PreparedFlight:
    """Reconstruct the sensor stream of a canonical flight; choose how its replays start and whose estimator does them.

    `None` leaves the stream as it was logged, and starts cold. `release` as in `ReplaySettings`.
    """
    chosen = Start(None, "asked for") if start is None else choose_start(flight, start)
    reconstructed = as_logged(flight) if reconstruction is None else reconstruct(flight, reconstruction, chosen.state)
    handovers = logged_handovers(flight)
    inputs, replayed = build_inputs(reconstructed.flight), replayed_release(flight, release).name
    return PreparedFlight(flight, inputs, reconstructed, chosen, tuple(gaps), handovers, replayed, release)
