"""Studies in which no set is better than the present one, or hardly: how often a change is recommended all the same.

All are made of the evidence of real studies, block sums of any aims, so that they do not ask how a rule decides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fusetune.apply.evidence import SMOOTHED, AimEvidence, FlightEvidence
from fusetune.apply.settings import DecisionSettings
from fusetune.set_names import PRESENT

from .rules import OLD, OURS, Rule, decide, rules
from .world import World, scores

HARDLY = 0.005
"""True difference of the scores of nearly equal sets: 0.5 % of a prediction error."""
LIKENESS = 0.1
"""Nearly equal sets differ from flight to flight by this share of what the real sets do."""
FEW_DRAWS = 2
"""Of the bootstrap: of several flights it only shows how close to each other the sets are that are proved better."""
VERSIONS = 6
"""Of each flight with its blocks drawn anew."""

EQUAL, PERSISTENT, SKEWED = "equal", "persistent", "persistent, skewed"
NEAR, NOISY = "nearly equal", "nearly equal, noisy"
MAIN_KINDS = (EQUAL, PERSISTENT, NEAR)
FEWER = 5
"""Of the other kinds, and for the old rule, this part of the studies is drawn."""

EvidenceOf = Callable[[World, int, np.random.Generator], list[FlightEvidence | None]]
"""World, number of flights, chance → evidence of the flights of one study."""


def false_changes(
    world: World, flights: int, draws: int, settings: DecisionSettings, generator: np.random.Generator
) -> dict[tuple[str, str], float]:
    """(rule, kind) → share of studies in which a change is recommended although no set is better, or hardly.

    The kinds:

    * *equal*: on every flight the names are dealt out anew among the sets;
    * *persistent*: on every flight each set is worth what a real set of chance is worth there, or the opposite;
    * *persistent, skewed*: what each set is worth on a flight stays as it is, and so does its spread over the flights,
      but its mean over the world is that of the present set: small losses on many flights and a large gain on few, or
      the reverse, for in half of the studies the sign of all that is turned;
    * *nearly equal*: the same with a tenth of the spread, and a mean that is better or worse by 0.5 %;
    * *nearly equal, noisy*: the present set with its blocks drawn anew for each set, better or worse by 0.5 %.
    """
    shares: dict[tuple[str, str], float] = {}
    quick = replace(settings, draws=FEW_DRAWS)
    for name in (OURS, OLD):
        source = world if name == OURS else _as_old(world)
        rule = rules(quick)[name]
        for kind, make in _kinds(source, generator).items():
            count = draws if name == OURS and kind in MAIN_KINDS else max(draws // FEWER, 1)
            changed = sum(_changes(world, rule, name, make(source, flights, generator)) for _ in range(count))
            shares[name, kind] = changed / count
    return shares


def _kinds(world: World, generator: np.random.Generator) -> dict[str, EvidenceOf]:
    whole = [flight.evidence for flight in world.flights]
    pairs = list(zip(_blended(whole, 1.0), mirrored(whole), strict=True))
    skewed = [with_means(whole, 0.0), with_means(mirrored(whole), 0.0)]
    near = [with_means(_alike(one), HARDLY) for one in (whole, mirrored(whole))]
    noisy = [with_means(blocks_redrawn(whole, generator), HARDLY) for _ in range(VERSIONS)]
    return {
        EQUAL: lambda world, flights, chance: [
            None if one is None else dealt_out(one, chance) for one in _drawn([whole], flights, chance)
        ],
        PERSISTENT: lambda world, flights, chance: [
            of_either_sign(*pairs[int(index)], chance) for index in chance.integers(0, len(pairs), flights)
        ],
        SKEWED: lambda world, flights, chance: _drawn(skewed, flights, chance),
        NEAR: lambda world, flights, chance: _drawn(near, flights, chance),
        NOISY: lambda world, flights, chance: _drawn_apart(noisy, flights, chance),
    }


def _drawn(
    versions: Sequence[Sequence[FlightEvidence | None]], flights: int, generator: np.random.Generator
) -> list[FlightEvidence | None]:
    """Flights with replacement out of one of some versions of the world."""
    version = versions[int(generator.integers(len(versions)))]
    return [version[int(index)] for index in generator.integers(0, len(version), flights)]


def _drawn_apart(
    versions: Sequence[Sequence[FlightEvidence | None]], flights: int, generator: np.random.Generator
) -> list[FlightEvidence | None]:
    """Each flight out of a version of its own."""
    return [_drawn(versions, 1, generator)[0] for _ in range(flights)]


def _changes(world: World, rule: Rule, name: str, evidence: Sequence[FlightEvidence | None]) -> bool:
    made = list(evidence)
    if name == OLD:
        study = replace(world, old_flights=tuple(made), old_vetoed={})
    else:
        # A delay that is wrong is wrong whatever the sets are worth.
        template, no_delays = world.flights[0], ((),) * len(made)
        flights = tuple(replace(template, evidence=one) for one in made)
        study = replace(world, flights=flights, delays=no_delays, vetoed={})
    return rule(study, range(len(made)), range(len(world.sets))) != 0


def _as_old(world: World) -> World:
    """The evidence of the decision before, where that of the present one stands."""
    template = world.flights[0]
    return replace(world, flights=tuple(replace(template, evidence=one) for one in world.old_flights))


def dealt_out(evidence: FlightEvidence, generator: np.random.Generator) -> FlightEvidence:
    """The names dealt out anew among the sets."""
    order = generator.permutation(len(evidence.sets))
    return replace(evidence, sets=tuple(evidence.sets[index] for index in order))


def of_either_sign(
    evidence: FlightEvidence | None, turned: FlightEvidence | None, generator: np.random.Generator
) -> FlightEvidence | None:
    """Each set is one of the others of chance, or its opposite, which `turned` holds; the present one stays.

    Both have the present set in their first row (`mirrored`).
    """
    if evidence is None or turned is None:
        return None
    count = len(evidence.sets)
    rows = np.r_[0, generator.integers(1, count, count - 1)]
    turn = (generator.random(count) < 0.5)[:, None, None]
    aims = tuple(
        replace(
            own,
            sum_nis=np.where(turn, its.sum_nis[rows], own.sum_nis[rows]),
            sum_log_variance=np.where(turn, its.sum_log_variance[rows], own.sum_log_variance[rows]),
        )
        for own, its in zip(evidence.aims, turned.aims, strict=True)
    )
    return replace(evidence, aims=aims)


def mirrored(flights: Sequence[FlightEvidence | None]) -> list[FlightEvidence | None]:
    """What each set has over the present one turned round: a block that it predicts better it predicts worse."""
    return _blended(flights, -1.0)


def _alike(flights: Sequence[FlightEvidence | None]) -> list[FlightEvidence | None]:
    """Sets that have `LIKENESS` of the differences to the present one."""
    return _blended(flights, LIKENESS)


def _blended(flights: Sequence[FlightEvidence | None], share: float) -> list[FlightEvidence | None]:
    def blend(aim: AimEvidence) -> AimEvidence:
        base, base_log = aim.sum_nis[:1], aim.sum_log_variance[:1]
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where((base > 0.0) & (aim.sum_nis > 0.0), (aim.sum_nis / base) ** share, 1.0)
        log_variance = base_log + share * (aim.sum_log_variance - base_log)
        return replace(aim, sum_nis=base * factor, sum_log_variance=log_variance)

    return [_present_first(one, blend) for one in flights]


def blocks_redrawn(
    flights: Sequence[FlightEvidence | None], generator: np.random.Generator
) -> list[FlightEvidence | None]:
    """Every set is the present one with blocks drawn anew for itself; blocks keep their numbers of samples."""

    def redraw(aim: AimEvidence) -> AimEvidence:
        blocks, columns = aim.n.shape
        sets = len(aim.sum_nis)
        picks = generator.integers(0, blocks, (sets, blocks))
        usable = aim.n > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            means = [np.where(usable, sums[0] / aim.n, 0.0) for sums in (aim.sum_nis, aim.sum_log_variance)]
        own = np.broadcast_to(np.arange(blocks)[None, :, None], (sets, blocks, columns))
        place = np.broadcast_to(np.arange(columns), own.shape)
        other = np.broadcast_to(picks[:, :, None], own.shape)
        other = np.where(usable[other, place], other, own)
        nis, log_variance = (mean[other, place] * aim.n for mean in means)
        return replace(aim, sum_nis=nis, sum_log_variance=log_variance)

    return [_present_first(one, redraw) for one in flights]


def _present_first(
    evidence: FlightEvidence | None, change: Callable[[AimEvidence], AimEvidence]
) -> FlightEvidence | None:
    """Aims changed by a function that finds the present set in the first row."""
    if evidence is None:
        return None
    first = evidence.sets.index(PRESENT)
    rows = [first, *(index for index in range(len(evidence.sets)) if index != first)]
    ordered = [
        replace(aim, sum_nis=aim.sum_nis[rows], sum_log_variance=aim.sum_log_variance[rows]) for aim in evidence.aims
    ]
    names = tuple(evidence.sets[index] for index in rows)
    return replace(evidence, sets=names, aims=tuple(change(aim) for aim in ordered))


def with_means(flights: Sequence[FlightEvidence | None], difference: float) -> list[FlightEvidence | None]:
    """Sets whose mean difference to the present one over the flights is, in turn, -`difference` and +`difference`.

    Each aim of each set is shifted as a whole, so what differs between flights and blocks stays. The plain mean of each
    aim is so, for each may prove something; as the weights of the flights differ, the whole score takes a further shift
    of the aim that has most of its weight, the smoothed one apart.
    """
    told = [one for one in flights if one is not None]
    names = sorted({name for one in told for name in one.sets} - {PRESENT})
    target = {name: difference * (-1.0) ** (1 + place) for place, name in enumerate(names)} | {PRESENT: 0.0}
    move = {name: _moves([one for one in told if name in one.sets], name, goal) for name, goal in target.items()}

    def shifted(one: FlightEvidence) -> FlightEvidence:
        aims = tuple(
            replace(aim, sum_nis=aim.sum_nis * np.exp([2.0 * move[name][aim.name] for name in one.sets])[:, None, None])
            for aim in one.aims
        )
        return replace(one, aims=aims)

    return [None if one is None else shifted(one) for one in flights]


def _moves(flights: Sequence[FlightEvidence], name: str, goal: float) -> dict[str, float]:
    """By how much each aim of a set is to be shifted."""
    found: dict[str, list[tuple[float, float]]] = {}
    for one in flights:
        for aim in one.aims:
            value = aim.scores[one.sets.index(name)] - aim.scores[one.sets.index(PRESENT)]
            found.setdefault(aim.name, []).append((aim.weight, float(value)))
    move = {aim: goal - float(np.mean([value for _, value in pairs])) for aim, pairs in found.items()}
    total = sum(weight * (value + move[aim]) for aim, pairs in found.items() for weight, value in pairs) - goal * len(
        flights
    )
    weights = {aim: sum(weight for weight, _ in pairs) for aim, pairs in found.items() if aim != SMOOTHED}
    if weights and max(weights.values()) > 0.0:
        first = max(weights, key=lambda aim: weights[aim])
        move[first] -= total / weights[first]
    return move


def coverage(
    world: World, flights: int, draws: int, settings: DecisionSettings, generator: np.random.Generator
) -> float:
    """Share of intervals that hold the true mean difference to the present set.

    The world is what its flights are drawn from, with replacement, so the truth is their mean.
    """
    true = np.nanmean(scores(world.flights, world.sets), axis=0)
    true = true - true[0]
    inside = []
    for _ in range(draws):
        drawn = generator.integers(0, len(world.flights), flights)
        _, ranked = decide(world, drawn.tolist(), range(len(world.sets)), settings)
        for one in ranked:
            if one.name != world.sets[0] and one.lower is not None and one.upper is not None:
                inside.append(one.lower <= true[world.sets.index(one.name)] <= one.upper)
    return float(np.mean(inside))
