"""What all sets of a flight are measured with: it follows from the present set and the log alone.

So a set has the same scores whichever others there are, and one that is added costs its own replay and scores.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.flight.reference_truth import GROUND_TRUTH_TOPICS, Truth, read_references
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.scoring.ground_metrics import ground_window
from fusetune.analyze.scoring.measurement_alignment import Masks, sample_masks
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.smoothed_scores import STEP_US, SmoothedMask, velocity_differences
from fusetune.analyze.scoring.true_errors import Reference
from fusetune.analyze.scoring.window import ScoringWindow, after, end_of_warm_up, scoring_window
from fusetune.analyze.scoring.withheld_scores import GapMask, gap_masks
from fusetune.analyze.sensors.source_whiteness import Whiteness, source_whiteness
from fusetune.analyze.smoothing.smoothed_velocity import smoothed_velocity
from fusetune.ekf2.replay.recording import SCORING, TRACED, Recording
from fusetune.px4.flight import Flight
from fusetune.set_names import ANTENNA_MENDED, mended_name

MOST_KEPT_STATES = 100_000
"""Some ten minutes of flight."""

WITH_MEASURED_ANTENNA = (ANTENNA_MENDED, mended_name(ANTENNA_MENDED))


@dataclass(frozen=True)
class ScoredFlight:
    """What scores need of the flight itself, beside the replays.

    Attributes
    ----------
    flight : canonical; of its topics only what nothing else stands for here
    log_gaps : gaps in the IMU samples of the log, µs
    onboard : innovations that the vehicle logged, by source and axis
    """

    flight: Flight
    log_gaps: tuple[Interval, ...]
    onboard: Mapping[SourceAxis, AxisSamples]


class Yardstick:
    """What the sets of a flight are measured with; each part is made when it is first asked for.

    Parameters
    ----------
    present : replay of the present set
    antenna : that of the set with the GNSS antenna's place as measured, where there is one. The measured velocities are
        those of the antenna, less what the told place makes of them. Smoothed with a wrong place, the velocity that all
        are compared with has the present set's error, and a set that mends it would seem to be farther off the truth.
    """

    def __init__(
        self,
        scored: ScoredFlight,
        present: ReplayedSet,
        settings: ScoringSettings | None = None,
        antenna: ReplayedSet | None = None,
    ) -> None:
        self.scored, self.present, self.settings = scored, present, settings or ScoringSettings()
        self._antenna = antenna
        self._states: FilterStates | None = None
        self.airborne: Sequence[Interval] = airborne_intervals(self.flight, present.flags)
        self.window: ScoringWindow = scoring_window(present, self.airborne, scored.log_gaps, self.settings)

    @property
    def flight(self) -> Flight:
        return self.scored.flight

    def window_of(self, record: ReplayedSet) -> ScoringWindow:
        """The window as it is for one set."""
        return self.window if record is self.present else self.window.of_set(record, self.settings)

    def flying(self, record: ReplayedSet) -> tuple[Interval, ...]:
        """Flight time of one set after its own warm-up: before it every filter resets and switches sources."""
        if self.window.warm_up_end is None:
            return tuple(self.airborne)
        return after(self.airborne, end_of_warm_up(record, self.present, self.settings))

    @cached_property
    def ground(self) -> ScoringWindow:
        """Time on the ground."""
        log = self.flight.start_timestamp, self.flight.last_timestamp
        gaps = self.scored.log_gaps
        return ground_window(self.present, self.airborne, log, gaps, self.window, self.settings)

    @cached_property
    def block_edges(self) -> npt.NDArray[np.int64]:
        """µs; of a flight of which something is scored."""
        return self.window.block_edges(self.settings.block_s)

    @cached_property
    def masks(self) -> Masks:
        """The measurements that are scored."""
        return sample_masks(self.present, self.window)

    @cached_property
    def ground_masks(self) -> Masks:
        """Those on the ground."""
        return sample_masks(self.present, self.ground)

    @cached_property
    def gaps(self) -> tuple[GapMask, ...]:
        """The predictions in gaps that are scored."""
        return gap_masks(self.present, self.window)

    @property
    def states(self) -> FilterStates:
        """Of the present set; of a long flight they are fetched each time, as they are large."""
        if self._states is not None:
            return self._states
        states = self.present.states()
        if states.time.size <= MOST_KEPT_STATES:
            self._states = states
        return states

    @cached_property
    def whiteness(self) -> Mapping[SourceAxis, Whiteness]:
        """How white the sources are, as the present set sees it."""
        if not self.window.intervals:
            return {}
        return source_whiteness(self.present, self.states, self.flight, self.window.intervals)

    @cached_property
    def references(self) -> tuple[Truth, ...]:
        """What the errors of the sets are known against."""
        if not self.window.intervals:
            return ()
        return tuple(read_references(self.flight, self.present.fused_sources, self.present.parameters))

    @cached_property
    def known_references(self) -> tuple[Reference, ...]:
        """The same with what sets share of them."""
        return tuple(map(Reference, self.references))

    @property
    def recording(self) -> Recording:
        """How much a replay has to record for its scores: errors need the published position at every update."""
        return TRACED if self.references else SCORING

    @cached_property
    def smoothed(self) -> SmoothedMask | None:
        """The smoothed velocity; None where there is none."""
        by = self.present
        if self._antenna is not None and not self.window_of(self._antenna).excluded:
            by = self._antenna
        reference = smoothed_velocity(by, self.flight, self.window.intervals, STEP_US)
        return None if reference is None else SmoothedMask(reference, velocity_differences(reference, self.states))

    def make(self) -> None:
        """Make all that scores ask for, so that several threads find it made."""
        if self.window.intervals:
            _ = self.masks, self.gaps, self.whiteness, self.known_references, self.smoothed
        _ = self.ground_masks, self.present.first_fused, self.present.reset_times
        # the references stand for it
        rest = {key: table for key, table in self.flight.topics.items() if key[0] not in GROUND_TRUTH_TOPICS}
        self.scored = replace(self.scored, flight=self.flight.with_topics(rest))
