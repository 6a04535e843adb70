"""Single effects that flights measure otherwise than PX4 is told, as findings with the value to set."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from fusetune.analyze.effects.estimate import Estimate
from fusetune.analyze.effects.joined_effects import FEWEST_FLIGHTS, JoinedEffects
from fusetune.apply.choice import Choice
from fusetune.apply.ranking import RankedSet, proved_sets
from fusetune.apply.settings import DecisionSettings
from fusetune.finding import Finding
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.set_names import EFFECT_SETS, mended_name

_PARAMETER_PREFIXES = ("EKF2_", "CAL_", "SENS_", "ASPD_")


def effect_findings(
    joined: JoinedEffects,
    choice: Choice,
    ranked: Sequence[RankedSet],
    changed: Collection[str],
    settings: DecisionSettings,
) -> tuple[Finding, ...]:
    """A finding for each effect with a value that lies beyond doubt from what PX4 is told.

    Parameters
    ----------
    ranked : the sets of the decision, those with measured effects among them
    changed : names of the parameters that the choice changes
    settings : of the decision
    """
    proved = {one.name for one in proved_sets(ranked, settings)}
    compared = {one.name: _Compared(one, one.name in proved) for one in ranked}
    sets = {effect: name for name, effect in EFFECT_SETS.items()}
    found = []
    for effect, estimates in joined.effects.items():
        apart = {name: one for name, one in estimates.items() if one.is_apart_from_told and _is_parameter(name)}
        if apart:
            remedy = _remedy(sets.get(effect), choice, compared, not set(apart) - set(changed))
            found.append(_finding(effect, apart, joined.flights[effect], remedy))
    return tuple(found)


def _is_parameter(name: str) -> bool:
    return name in PARAMETERS or name.startswith(_PARAMETER_PREFIXES)


@dataclass(frozen=True)
class _Compared:
    """A set of the decision, and whether it is better than the present one beyond doubt."""

    ranked: RankedSet
    is_proved: bool


def _remedy(name: str | None, choice: Choice, compared: Mapping[str, _Compared], is_changed: bool) -> str:
    """What to do about it: sets that were compared answer by themselves."""
    tried = [one for one in (name, mended_name(name)) if one in compared] if name is not None else []
    if not tried:
        return "Set {values} and fly again: no innovation of the filter tells whether it is right"
    if choice.chosen in tried:
        return "Set by the choice: {values}"
    if is_changed:
        return f"Set by the choice, {choice.chosen}, to values of its own; measured: {{equal}}"
    one = compared[tried[0]]
    if one.is_proved and not choice.mends_delays:
        return (
            f"The set {tried[0]} with {{equal}} is better than what flies now, too, and {choice.chosen} is to be "
            "preferred: set that, fly, and compare again"
        )
    if one.ranked.equal_to_present:
        return (
            f"The set {tried[0]} with {{equal}} does the same as what flies now, as the filter does not use it so; "
            "nothing is set"
        )
    return f"The set {tried[0]} was compared with {{equal}}; it was not chosen, so nothing is set"


def _finding(effect: str, apart: Mapping[str, Estimate], flights: Sequence[str], remedy: str) -> Finding:
    told = ", ".join(f"{name} is measured as {_in_words(one)}" for name, one in apart.items())
    single = len(flights) < FEWEST_FLIGHTS
    to_set = {verb: ", ".join(f"{name} {verb} {one.value:.3g}" for name, one in apart.items()) for verb in ("to", "=")}
    advice = remedy.format(values=to_set["to"], equal=to_set["="])
    return Finding(
        id=f"effect.{effect}",
        severity="note",
        found=told + (", as far as one flight can tell" if single else ""),
        remedy="Fly and add another flight of the same kind" if single else advice,
        evidence={"flights": len(flights)},
    )


def _in_words(one: Estimate) -> str:
    """Value, interval, and what is told."""
    words = f"{one.value:.3g} {one.unit} (95 %: {one.lower:.3g} to {one.upper:.3g}), told {one.told:g}"
    return words.replace("-", "−")
