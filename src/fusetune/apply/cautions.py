"""What speaks against a change, or what its evidence cannot see: said together with it.

The flights show velocities and how far a set drifts without GNSS. Slow errors of a source, which the filter follows,
stay in its position and height and no innovation tells of them; attitude shows only by what it does to the velocity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.parameter_changes import ParameterChange
from fusetune.apply.ranking import RankedSet
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.aid_sources import AID_SOURCES

WORTH_SAYING = math.log(1.01)
"""A mean difference, nat, from which on a kind of prediction is said to be worse, proved or not."""

_WAYS = {
    AIDED: "one step ahead, with all sensors in use,",
    UNAIDED: "after seconds without GNSS",
    SMOOTHED: "of the velocity, against the one that the whole flight makes likely,",
}


def cautions(
    pick: RankedSet, changes: Sequence[ParameterChange], whiteness: Mapping[str, float], settings: DecisionSettings
) -> tuple[str, ...]:
    """Sentences about a set that is to be flown instead of the present one.

    Parameters
    ----------
    changes : parameters in which it differs from what flies now
    whiteness : how white the error of each source is, the mean over the flights
    """
    return (*_worse_kinds(pick), *_followed(changes, whiteness, settings), *_attitude(changes), _UNSEEN)


_UNSEEN = "Attitude and heading are judged only by what they do to velocity and position."


def _attitude(changes: Sequence[ParameterChange]) -> list[str]:
    """What turns the attitude more readily: velocities that are trusted more, and gyros that are told otherwise."""
    trusted = [one for one in changes if 0.0 < one.value < one.previous and one.name in _VELOCITY_NOISES]
    gyros = [one for one in changes if one.name == "EKF2_GYR_NOISE"]
    values = ", ".join(f"{one.name} {one.previous:g} → {one.value:g}" for one in (*trusted, *gyros))
    if not values:
        return []
    return [f"Mind its attitude ({values}): it may be less exact though velocity and position are better."]


_VELOCITY_NOISES = tuple(
    name for source in AID_SOURCES.values() if source.quantity == "velocity" for name in source.noises
)


def _worse_kinds(pick: RankedSet) -> list[str]:
    return [
        f"Mind that {_WAYS[name]} its errors are {100.0 * math.expm1(aim.difference):.1f} % larger than now."
        for name, aim in pick.aims.items()
        if aim.difference > WORTH_SAYING
    ]


def _followed(
    changes: Sequence[ParameterChange], whiteness: Mapping[str, float], settings: DecisionSettings
) -> list[str]:
    """Sources that are trusted more though their errors wander, a sentence per quantity that follows them."""
    found = [
        (source.quantity, source.label, change)
        for change in changes
        if 0.0 < change.value < change.previous
        for source in AID_SOURCES.values()
        if change.name in source.noises and whiteness.get(source.name, 1.0) < settings.distrust_white_share
    ]
    sentences = []
    for quantity, group in groupby(sorted(found, key=lambda one: one[0]), key=lambda one: one[0]):
        members = list(group)
        sources = " and ".join(dict.fromkeys(label for _, label, _ in members))
        values = ", ".join(dict.fromkeys(f"{one.name} {one.previous:g} → {one.value:g}" for _, _, one in members))
        sentences.append(
            f"Mind that it trusts {sources} more ({values}), whose errors wander on these flights: its {quantity} may "
            "follow them, which nothing here measures."
        )
    return sentences
