"""What is wrong on a flight: all causes asked, consequences taken out, what explains most first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fusetune.analyze.diagnosis.causes.registry import CAUSES
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.experiments import AT_MOST, with_experiments
from fusetune.analyze.diagnosis.explained_away import explained_away
from fusetune.analyze.diagnosis.innovation_signs import GATE
from fusetune.analyze.diagnosis.reliability import calibrated
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.effects.all_effects import FlightEffects
from fusetune.analyze.observed.observed_flight import ObservedFlight

UNKNOWN = "unknown"
UNKNOWN_FROM = 0.15
"""Share of the ratios of a source beyond the gate from which on something is wrong, whatever it is."""
SEVERITIES = ("note", "warning", "fail")


def diagnose(
    observed: ObservedFlight, experiments: int = AT_MOST, effects: FlightEffects | None = None
) -> tuple[Diagnosis, ...]:
    """What is wrong, what explains most first; empty where nothing is.

    A flight that cannot be replayed is asked, too: rules that need a replay say nothing then.

    Parameters
    ----------
    experiments : how many of the first claims are tried by another replay at most
    effects : of the same flight, where they are asked for elsewhere as well
    """
    signs = Signs(observed, effects)
    found = [one for cause in CAUSES.values() if (one := cause(signs)) is not None]
    left = with_experiments(in_order(explained_away(found)), signs, experiments)
    if not any(one.severity != "note" for one in left):
        unknown = _unknown(signs)
        left += [unknown] if unknown is not None else []
    # what is unknown claims no cause
    return tuple(
        one if one.id == UNKNOWN else replace(one, confidence=calibrated(one.confidence)) for one in in_order(left)
    )


def in_order(found: Sequence[Diagnosis]) -> tuple[Diagnosis, ...]:
    """Notes last; of the others what explains most, as far as it is sure, first."""
    return tuple(sorted(found, key=lambda one: (one.severity == "note", -one.explains * one.confidence, one.id)))


def _unknown(signs: Signs) -> Diagnosis | None:
    """That innovations are bad, and no cause fits."""
    bad = {name: one for name, one in signs.ratios.items() if one.above_gate > UNKNOWN_FROM}
    if not bad:
        return None
    found = tuple(
        Sign(
            f"{one.above_gate:.0%} of the test ratios of {name} are above 1",
            one.above_gate,
            UNKNOWN_FROM,
            "1",
            one.origin,
        )
        for name, one in sorted(bad.items(), key=lambda item: -item[1].excess)
    )
    times = [one.off for one in bad.values() if one.off is not None]
    return Diagnosis(
        UNKNOWN,
        "Innovations are too large, and no known cause fits",
        "warning",
        0.5,
        sum(one.excess for one in bad.values()),
        min(start for start, _ in times),
        max(stop for _, stop in times),
        found,
        "Look at the innovations of these sources on the flight's page: when they grow, and what the vehicle did then",
        f"test ratios above {GATE:g} (PX4 rejects such measurements)",
    )
