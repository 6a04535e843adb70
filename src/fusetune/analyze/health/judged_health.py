"""A flight as the parts of the health table see it: windows, parameters, instances, limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight, TopicTable, row_count
from fusetune.px4.layouts.estimator_instances import primary_instance

INSTANCE_TOPICS = ("estimator_status", "estimator_states", "estimator_innovations", "ekf2_innovations")
"""Each estimator instance publishes one of them at least."""


@dataclass(frozen=True)
class JudgedHealth:
    """A flight and the limits of its health."""

    observed: ObservedFlight
    limits: HealthSettings

    @property
    def flight(self) -> Flight:
        """In the layout of v1.16."""
        return self.observed.flight

    @property
    def logged(self) -> Flight:
        """In the layout of its release."""
        return self.observed.logged

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the estimator that the log begins with, in the names of v1.16."""
        return self.observed.parameters

    @cached_property
    def airborne(self) -> tuple[Interval, ...]:
        """When the vehicle flew, µs; shorter hops left out."""
        return self._long_enough(self.observed.airborne)

    @cached_property
    def clear(self) -> tuple[Interval, ...]:
        """The same without take-off and landing."""
        return self._long_enough(self.observed.clear_of_ground)

    @cached_property
    def instances(self) -> tuple[int, ...]:
        """Estimator instances of which the log holds something; none where it holds nothing of any."""
        return tuple(sorted({one for name in INSTANCE_TOPICS for one in self.logged.instances(name)}))

    @cached_property
    def primary(self) -> int:
        """The instance that was primary for most of the flight."""
        return primary_instance(self.logged)

    def topic(self, name: str, instance: int = 0) -> TopicTable | None:
        """A canonical topic that has rows; None where there are none."""
        table = self.flight.topic(name, instance)
        return table if table is not None and row_count(table) else None

    def name_of(self, label: str, instance: int | None) -> str:
        """A label with the estimator instance, where there are several."""
        return f"{label} (estimator {instance})" if instance is not None and len(self.instances) > 1 else label

    def _long_enough(self, intervals: tuple[Interval, ...]) -> tuple[Interval, ...]:
        return tuple(one for one in intervals if (one[1] - one[0]) * 1e-6 >= self.limits.min_flight_s)
