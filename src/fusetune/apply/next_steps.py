"""What to do next: every decision ends with at most three steps, the most useful first, each of which the evidence asks
for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fusetune.apply.candidates import Candidate
from fusetune.apply.choice import Choice
from fusetune.apply.delays import UNCONFIRMED
from fusetune.apply.evidence import DISTRUSTED, AnalyzedFlight
from fusetune.apply.missing_motion import LOG_PROFILE, MissingMotion
from fusetune.apply.missing_motion_kinds import DELAYS, LEVER_ARMS, NOISES, THINNED
from fusetune.apply.parameter_changes import ParameterChange
from fusetune.apply.parameter_files.vehicle_changes import RefusedChange
from fusetune.apply.power.power import ENOUGH, GAINS_PERCENT, LONGER_MINUTES, Power
from fusetune.apply.ranking import RankedSet
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.wording import counted, named
from fusetune.finding import Finding, from_documents

MOST_STEPS = 3
MOST_FLIGHTS = 20
"""More flights than this nobody flies for one question."""
_CANDIDATES_NAMED = 2

LOG, LOAD, CONFIRM, FLY, STUDY, SEARCH, STOP, OWN_LOGS = (
    "log", "load", "confirm", "fly", "study", "search", "stop", "own_logs",
)  # fmt: skip

SEARCH_COMMAND = "fusetune search flights/*.ulg --out results/search"
STUDY_COMMAND = "cp results/apply/candidates.yaml candidates.yaml && fusetune run --study candidates.yaml"


@dataclass(frozen=True)
class NextStep:
    """One thing to do.

    Attributes
    ----------
    kind : `LOG`, `LOAD`, `CONFIRM`, `FLY`, `STUDY`, `SEARCH`, `STOP` or `OWN_LOGS`
    text : what, and why, in a sentence or two
    command : to be run as it stands; empty where there is none
    """

    kind: str
    text: str
    command: str = ""


@dataclass(frozen=True)
class Situation:
    """What the next steps follow from.

    Attributes
    ----------
    is_simulated : whether the flights are of a simulated vehicle
    candidates : sets that the evidence asks for
    delays : findings about them, as confirmed or not by the decision
    missing : what the flights cannot tell by how they moved
    overrides : name of each set → parameters to which it gives other values than the present ones
    refused : remedies for the logs that were refused, one for each finding, in any order
    not_loadable : changes that the vehicle cannot be given
    """

    choice: Choice
    ranked: Sequence[RankedSet]
    flights: Sequence[AnalyzedFlight]
    changes: Sequence[ParameterChange]
    candidates: Sequence[Candidate]
    delays: Sequence[Finding]
    missing: Sequence[MissingMotion]
    power: Power | None
    overrides: Mapping[str, Sequence[str]]
    refused: Sequence[str] = ()
    not_loadable: Sequence[RefusedChange] = ()
    is_simulated: bool = False

    @property
    def deciding(self) -> int:
        """Number of flights that decide."""
        return sum(one.evidence is not None for one in self.flights)


def next_steps(now: Situation, settings: DecisionSettings) -> tuple[NextStep, ...]:
    """At most `MOST_STEPS`, the most useful first."""
    if now.is_simulated:
        own = "These flights are simulated: put logs of your vehicle into flights/ and run again."
        return (NextStep(OWN_LOGS, own),)
    if now.choice.status == "no_evidence":
        steps = [*_logging(now), _first_flights(settings)]
    elif now.choice.status == "change":
        steps = _after_a_change(now, settings)
    else:
        steps = _after_keeping(now, settings)
    return tuple(steps[:MOST_STEPS])


def steps_sentence(steps: Sequence[NextStep]) -> str:
    """The last paragraph of the decision."""
    if len(steps) == 1:
        return f"Next: {steps[0].text}"
    return "Next: " + " ".join(f"({number}) {one.text}" for number, one in enumerate(steps, start=1))


def refused_remedies(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Remedies for what refused logs lack.

    Parameters
    ----------
    rows : of `results/save/flights.parquet`
    """
    refused = [row for row in rows if row["status"] == "refused"]
    return [one.remedy for row in refused for one in from_documents(row.get("advice")) if one.severity == "fail"]


def _logging(now: Situation) -> list[NextStep]:
    """What to log, where logs were refused or their replays are not trusted."""
    distrusted = sum(one.without is not None and one.without.kind == DISTRUSTED for one in now.flights)
    if now.refused:
        # the most frequent; of equals the first by name, so that the order of logs does not matter
        remedy = min(Counter(now.refused).items(), key=lambda one: (-one[1], one[0]))[0].rstrip(".")
        return [
            NextStep(LOG, f"{remedy[:1].upper()}{remedy[1:]} (for each refused log, flights.csv says what it lacks).")
        ]
    if distrusted:
        profile = LOG_PROFILE[:1].upper() + LOG_PROFILE[1:]
        return [NextStep(LOG, f"{profile}: the replays of {counted(distrusted, 'flight')} are too far from what flew.")]
    return []


def _first_flights(settings: DecisionSettings) -> NextStep:
    return NextStep(
        FLY,
        f"Fly at least {counted(settings.minimum_flights, 'flight')} of {LONGER_MINUTES:g} minutes with GNSS, fast and "
        "slow, with turns and climbs, and add their logs.",
    )


def _after_a_change(now: Situation, settings: DecisionSettings) -> list[NextStep]:
    reboot = ", reboot" if any(one.reboot_required for one in now.changes) else ""
    if now.not_loadable:
        first = now.not_loadable[0]
        text = f"{first.remedy} ({first.name}: {first.reason}), and run again: nothing can be loaded as it is."
        return [NextStep(STUDY, text)]
    few = now.choice.exploratory
    careful = f"it rests on {counted(now.deciding, 'flight')} only, so " if few else ""
    load = NextStep(LOAD, f"Load best_params.params{reboot}, and fly a short, safe flight first.")
    count = _flights_to_confirm(now, settings)
    confirm = NextStep(
        CONFIRM,
        f"Then {careful}fly {counted(count, 'flight')}{_length(now.power)} with it, add the logs and run again: they "
        "confirm the change, or not.",
    )
    back = NextStep(LOAD, "If the vehicle flies worse, load rollback.params: it brings the old values back.")
    return [load, confirm, back]


def _flights_to_confirm(now: Situation, settings: DecisionSettings) -> int:
    """As many as find a gain of the size that was found, and no fewer than a firm decision takes."""
    gain = now.choice.pick.improvement_percent if now.choice.pick else 0.0
    if now.power is None:
        return settings.minimum_flights
    smaller = [one for one in (now.power.longer or now.power.curves) if one.gain_percent <= gain]
    needed = smaller[-1].needed if smaller else None
    return min(max(needed or settings.minimum_flights, settings.minimum_flights), MOST_FLIGHTS)


def _after_keeping(now: Situation, settings: DecisionSettings) -> list[NextStep]:
    open_sets = _could_matter(now.ranked, settings)
    tried = [one for one in now.ranked if one.flights and not one.is_present and not one.equal_to_present]
    late = [one for one in now.delays if one.id == UNCONFIRMED]
    study = [_study(now.candidates)] if now.candidates else []
    if now.choice.exploratory:
        return [_fly_to_be_firm(now, settings), *study, *_log_whole(now)]
    if late:
        return [_delay_step(late[0]), *study, *_fly_otherwise(now)]
    if open_sets:
        text = f"{_parameters_that_could_matter(open_sets, now)}: search around the present values."
        return [*_fly_for_power(now), *study, NextStep(SEARCH, text, SEARCH_COMMAND)]
    if study:
        return [*study, *_fly_otherwise(now)]
    if tried and all(one.lower is not None and one.lower >= settings.smallest_gain for one in tried):
        return [_stop(tried, now, settings)]
    return [NextStep(SEARCH, _why_search(tried, now), SEARCH_COMMAND), *_fly_otherwise(now)]


def _study(candidates: Sequence[Candidate]) -> NextStep:
    ways = "; ".join(_values(one) for one in candidates[:_CANDIDATES_NAMED])
    if len(candidates) > _CANDIDATES_NAMED:
        ways += f"; and {len(candidates) - _CANDIDATES_NAMED} more"
    return NextStep(STUDY, f"Compare what these flights ask for, ready in candidates.yaml: {ways}.", STUDY_COMMAND)


def _could_matter(ranked: Sequence[RankedSet], settings: DecisionSettings) -> list[RankedSet]:
    """Eligible sets of which the flights do not rule out a gain that matters, the most promising first."""
    able = [one for one in ranked if one.is_eligible and (one.lower is None or one.lower < settings.smallest_gain)]
    return sorted(able, key=lambda one: (one.difference, one.name))


def _parameters_that_could_matter(open_sets: Sequence[RankedSet], now: Situation) -> str:
    names = list(dict.fromkeys(name for one in open_sets for name in now.overrides.get(one.name, ())))
    if not names:
        return "Some sets could still be better"
    return f"{named(names)} could still matter"


def _fly_to_be_firm(now: Situation, settings: DecisionSettings) -> NextStep:
    more = max(settings.minimum_flights - now.deciding, 1)
    known = now.power.more(10.0) if now.power is not None else None
    text = f"Fly {more} more {'flight' if more == 1 else 'flights'}{_length(now.power)}{_motion(now)} and run again"
    if known is not None and known > more:
        return NextStep(FLY, f"{text}; for a gain of 10 % it takes {known} more.")
    return NextStep(FLY, f"{text}: fewer than {settings.minimum_flights} show nothing firm.")


def _fly_for_power(now: Situation) -> list[NextStep]:
    """As many flights as find a gain that these could not be sure to find; first the usual one of 10 %."""
    if now.power is None:
        return []
    wanted = sorted(GAINS_PERCENT, key=lambda gain: (gain != 10.0, gain))
    for gain in wanted:
        more = now.power.more(gain)
        if more and more <= MOST_FLIGHTS:
            minutes = f" of {_minutes(now.power.next_minutes)}"
            return [
                NextStep(
                    FLY,
                    f"With {counted(more, 'more flight')}{minutes}{_motion(now)}, a gain of {gain:g} % would be found "
                    f"with {100.0 * ENOUGH:.0f} %.",
                )
            ]
    return []


def _fly_otherwise(now: Situation) -> list[NextStep]:
    """Logs that hold more, then flights of another kind, where these would tell more."""
    moving = [one for one in now.missing if one.kind != THINNED]
    return [*_log_whole(now), *(NextStep(FLY, f"{one.cannot}; fly {one.fly}.") for one in moving[:1])]


def _log_whole(now: Situation) -> list[NextStep]:
    return [NextStep(LOG, f"{one.cannot}: {one.fly}.") for one in now.missing if one.kind == THINNED]


def _motion(now: Situation) -> str:
    moving = [one for one in now.missing if one.kind in (DELAYS, NOISES, LEVER_ARMS)]
    return f", with {' and '.join(one.fly for one in moving[:2])}" if moving else ""


def _length(power: Power | None) -> str:
    return f" of {_minutes(power.next_minutes if power is not None else LONGER_MINUTES)}"


def _minutes(minutes: float) -> str:
    rounded = max(round(2.0 * minutes) / 2.0, 0.5)
    return f"{rounded:g} minute{'' if rounded == 1.0 else 's'}"


def _delay_step(late: Finding) -> NextStep:
    parameter, value = late.evidence["parameter"], late.evidence["mended_ms"]
    text = (
        f"{parameter} is measured as {value:g}, but beside the present noises the predictions are no better with it: "
        "search delay and noises together."
    )
    return NextStep(SEARCH, text, SEARCH_COMMAND)


def _stop(tried: Sequence[RankedSet], now: Situation, settings: DecisionSettings) -> NextStep:
    names = list(dict.fromkeys(name for one in tried for name in now.overrides.get(one.name, ())))
    which = f" ({named(names)})" if names else ""
    return NextStep(
        STOP,
        f"These parameters are fine as they are, stop tuning them{which}: no value that was tried gains "
        f"{settings.smallest_gain_percent:g} % on these flights.",
    )


def _why_search(tried: Sequence[RankedSet], now: Situation) -> str:
    if len(now.ranked) == 1:
        return "There was no other set to compare: search around the present values."
    if not tried:
        return "No set acted on these flights: search around the present values instead."
    if all(one.is_vetoed for one in tried):
        return "Every set that was tried is ruled out: search nearer to the present values."
    return "None of these sets is better: search around the present values for ones that are."


def _values(candidate: Candidate) -> str:
    return " and ".join(f"{name} {value:g}" for name, value in candidate.overrides.items())
