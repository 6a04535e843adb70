"""Effects of all flights of a vehicle together, and the sets that follow where PX4 is told otherwise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fusetune.analyze.effects.effect_files import read_effects
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.pooled import pooled
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, as_float32
from fusetune.save.flights_table import of_same_vehicle
from fusetune.set_names import EFFECT_SETS
from fusetune.storage.documents import read_as, write_document
from fusetune.storage.files import AnyPath, atomic_path

FEWEST_FLIGHTS = 2
"""One flight shows no scatter between flights: what it tells is told, and no set follows."""
NOT_IN_THE_FILTER = ("EKF2_TAU_VEL", "EKF2_TAU_POS", "EKF2_RNG_K_GATE")
"""Parameters that no innovation tells anything of: of the output predictor, and of a check that only rejects."""
_DIGITS = 3


@dataclass(frozen=True)
class JoinedEffects:
    """What the flights of a vehicle tell.

    Attributes
    ----------
    effects : id of the effect → its estimates over the flights, by name
    flights : id → names of the flights that told it
    refusals : id → why not, of effects that no flight told; the newest flight's words
    """

    effects: Mapping[str, Mapping[str, Estimate]]
    flights: Mapping[str, tuple[str, ...]]
    refusals: Mapping[str, str]

    @property
    def sets(self) -> dict[str, dict[str, float]]:
        """Sets that try what is told otherwise beyond doubt: name, one of `EFFECT_SETS`, → values."""
        found = {}
        for name, effect in EFFECT_SETS.items():
            values = self._values(effect) if len(self.flights.get(effect, ())) >= FEWEST_FLIGHTS else {}
            if values:
                found[name] = values
        return found

    def _values(self, effect: str) -> dict[str, float]:
        """Parameters of EKF2 to change."""
        estimates = self.effects.get(effect, {})
        values = {name: _settable(one) for name, one in estimates.items() if one.is_apart_from_told}
        return {
            name: value
            for name, value in values.items()
            if value is not None and name not in NOT_IN_THE_FILTER and value != estimates[name].told
        }


def _settable(one: Estimate) -> float | None:
    """The value that PX4 takes, in a few digits; None where it is no parameter of EKF2."""
    limits = PARAMETERS.get(one.name)
    if limits is None or not math.isfinite(one.value):
        return None
    value = float(f"{one.value:.{_DIGITS}g}")
    value = max(value, limits.minimum) if limits.minimum is not None else value
    value = min(value, limits.maximum) if limits.maximum is not None else value
    return as_float32(value)


def join_effects(flights: Mapping[str, Sequence[Effect]]) -> JoinedEffects:
    """Join what flights of one vehicle tell, name → effects, oldest first."""
    by_id: dict[str, list[tuple[str, Effect]]] = {}
    for name, effects in flights.items():
        for one in effects:
            by_id.setdefault(one.id, []).append((name, one))
    told = {key: [(name, one) for name, one in found if one.estimates] for key, found in by_id.items()}
    return JoinedEffects(
        {key: pooled([one for _, one in found]) for key, found in told.items() if found},
        {key: tuple(name for name, _ in found) for key, found in told.items() if found},
        {key: by_id[key][-1][1].refusal for key, found in told.items() if not found},
    )


def write_joined_effects(
    files: Mapping[str, AnyPath], newest: str | None, flights_table: AnyPath, output: AnyPath
) -> JoinedEffects:
    """Join the `effects.json` of the newest flight's vehicle, by name of the flight, and write what was found."""
    names = of_same_vehicle(flights_table, files, newest)
    joined = join_effects({name: read_effects(files[name]) for name in names})
    document = {
        "effects": {
            key: {name: asdict(one) for name, one in estimates.items()} for key, estimates in joined.effects.items()
        },
        "flights": dict(joined.flights),
        "refusals": dict(joined.refusals),
        "sets": joined.sets,
    }
    with atomic_path(output) as temporary:
        write_document(temporary, document)
    return joined


def read_joined_effects(file: AnyPath) -> JoinedEffects:
    """Read what `write_joined_effects` wrote; `UserError` where that cannot be."""
    return read_as(file, _joined_of, "what flights tell of single effects")


def _joined_of(document: Mapping[str, Any]) -> JoinedEffects:
    return JoinedEffects(
        {key: {name: Estimate(**one) for name, one in found.items()} for key, found in document["effects"].items()},
        {key: tuple(names) for key, names in document["flights"].items()},
        document["refusals"],
    )
