"""Parameter sets evaluated on a flight in memory, without any file: for searches, and for whoever uses the package.

The pipeline makes its files of the same functions, so that a set has the same scores here and there.
"""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.scoring.score_sets import FlightScores, score_sets, scored_flight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.set_names import PRESENT


def evaluate(
    prepared: PreparedFlight,
    sets: Mapping[str, Mapping[str, float] | ReplayedSet],
    *,
    present: str = PRESENT,
    settings: ScoringSettings | None = None,
) -> FlightScores:
    """Replay parameter sets on a flight and score them.

    All sets are scored on the present set's samples, and clipped at its limits: what a candidate lacks there costs it
    alone. A search that asks for one candidate after the other hands
    on the present set's replay, so that it is made once and two sets are in memory at a time::

        now = replay_set(prepared, "present", {})
        for candidate in asked:
            scores = evaluate(prepared, {"present": now, "candidate": candidate})

    Parameters
    ----------
    prepared : from `fusetune.analyze.replaying.prepared_flight.prepare_flight`, of a flight with all its topics
    sets : name of each set → the parameters in which it differs from the log's own, or its replay by `replay_set`
    present : the set that the others are compared with, one of `sets`
    settings : how the flight is scored

    Raises
    ------
    KeyError
        The present set is not among the sets.
    """
    replays = {
        name: one if isinstance(one, ReplayedSet) else replay_set(prepared, name, one) for name, one in sets.items()
    }
    if present not in replays:
        raise KeyError(present)
    scored = scored_flight(prepared.flight, settings)
    return score_sets(scored, replays.values(), present=present, settings=settings)
