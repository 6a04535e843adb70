"""How the decision is made; read from the section `decision` of the configuration. `docs/decision.md` argues for it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from fusetune.errors import UserError
from fusetune.px4.aid_sources import AXES, MEASURED_SOURCES, WITHHOLDABLE
from fusetune.settings import setting, settings_from_mapping
from fusetune.storage.files import AnyPath

MULTIPLICITY = ("sign_flips", "holm", "none")
"""Ways to allow for the best of many candidates looking better than it is, see `fusetune.apply.choice`."""

GRADES = ("A", "B", "C", "D")
"""Trust grades of a flight's replay, the best first."""


@dataclass(frozen=True)
class DecisionSettings:
    """Rules of the decision.

    `sources` are the aid sources whose one-step predictions count, `withheld_sources` those that are predicted while
    their sensor is withheld, whole ("gnss_pos") or one axis of them ("gnss_vel.z"), each with its weight.
    """

    sources: Mapping[str, float] = field(
        default_factory=lambda: {"gnss_vel": 1.0, "ev_vel": 1.0, "ev_pos": 1.0, "optical_flow": 1.0}
    )
    withheld_sources: Mapping[str, float] = field(default_factory=lambda: {"gnss_pos": 3.0, "gnss_vel.z": 1.0})
    aided_weight: float = setting(1.0, 0.0, 100.0, "", "weight of the predictions one step ahead")
    unaided_weight: float = setting(1.0, 0.0, 100.0, "", "weight of the predictions without the sensor")
    distrust_white_share: float = setting(0.6, 0.0, 1.0, "", "a source whose error is less white has no say")
    trust_white_share: float = setting(0.9, 0.0, 1.0, "", "a source whose error is whiter has its full weight")
    multiplicity: str = setting("sign_flips", None, None, "", "allowance for the best of many sets being lucky")
    equivalence_percent: float = setting(1.0, 0.0, 100.0, "%", "errors so much larger may be traded for nearness")
    lowest_grade: str = setting("C", None, None, "", "flights whose replay has a lower trust grade do not count")
    confidence: float = setting(0.95, 0.5, 0.999, "", "level of the intervals")
    draws: int = setting(4000, 200, 200_000, "", "number of bootstrap draws")
    minimum_flights: int = setting(5, 1, 1000, "", "with fewer scored flights the decision is called exploratory")
    seed: int = setting(0, 0, 2**63 - 1, "", "seed of the bootstrap")

    def trust(self, white_share: float) -> float:
        """Weight of a source, 0 … 1, whose error is as white as this."""
        span = self.trust_white_share - self.distrust_white_share
        if span <= 0.0:
            return float(white_share >= self.trust_white_share)
        return min(max((white_share - self.distrust_white_share) / span, 0.0), 1.0)

    @property
    def main_source(self) -> str:
        """The source that the figures beside the score are shown of."""
        return max(self.sources, key=lambda source: self.sources[source])

    @classmethod
    def from_mapping(
        cls, values: Mapping[str, Any] | None, seed: int | None = None, file: AnyPath = "config/config.yaml"
    ) -> "DecisionSettings":
        """Read the section `decision`; `seed` is the one of the whole configuration, where the section has none.

        Raises
        ------
        UserError
            For a key that does not exist, a source that does not, or a value out of its range.
        """
        values = dict(values or {})
        if seed is not None:
            values.setdefault("seed", seed)
        weights: dict[str, Any] = {
            key: _weights(values.pop(key), key, allowed, file)
            for key, allowed in (("sources", tuple(MEASURED_SOURCES)), ("withheld_sources", _withheld_sources()))
            if key in values
        }
        settings = settings_from_mapping(cls, values, "decision", file)
        for key, allowed in (("multiplicity", MULTIPLICITY), ("lowest_grade", GRADES)):
            if getattr(settings, key) not in allowed:
                value = getattr(settings, key)
                raise UserError(file, f"decision.{key} is {value!r}", f"Use one of: {', '.join(allowed)}")
        return replace(settings, **weights)


def _withheld_sources() -> tuple[str, ...]:
    """Sources that are predicted without their sensor, whole and by axis."""
    sources = tuple(source for sources in WITHHOLDABLE.values() for source in sources)
    return (*sources, *(f"{source}.{axis}" for source in sources for axis in AXES[: MEASURED_SOURCES[source].axes]))


def _weights(value: Any, key: str, allowed: tuple[str, ...], file: AnyPath) -> dict[str, float]:
    if not isinstance(value, Mapping) or not value:
        raise UserError(file, f"decision.{key} is {value!r}", "Give one or more aid sources with their weights")
    for source, weight in value.items():
        if source not in allowed:
            raise UserError(
                file,
                f"decision.{key} names {source!r}, which is no aid source that can be used there",
                f"Use one of: {', '.join(sorted(allowed))}",
            )
        if isinstance(weight, bool) or not isinstance(weight, int | float) or not 0.0 <= weight < float("inf"):
            raise UserError(file, f"decision.{key}.{source} is {weight!r}", "A weight is a number of at least 0")
    return {source: float(weight) for source, weight in value.items()}
