"""The decision in words that a pilot understands."""

from collections.abc import Sequence

from fusetune.apply.choice import Choice
from fusetune.apply.evidence import AIDED, UNAIDED, AnalyzedFlight
from fusetune.apply.ranking import RankedSet, improvement_percent, is_proved
from fusetune.apply.settings import DecisionSettings

_MOST_NAMES = 4


def paragraph(
    choice: Choice, ranked: Sequence[RankedSet], flights: Sequence[AnalyzedFlight], settings: DecisionSettings
) -> str:
    """The decision, its evidence and its limits in a few sentences."""
    scored = [flight for flight in flights if flight.evidence is not None]
    if choice.status == "no_evidence":
        return _no_evidence(flights)
    minutes = sum(flight.summary["scored_s"] for flight in scored) / 60.0
    sentences = [
        f"Fly the set “{choice.chosen}”." if choice.status == "change" else "Keep the parameters that fly now.",
        f"{_count(len(ranked), 'parameter set')} {'was' if len(ranked) == 1 else 'were'} replayed on "
        f"{_count(len(scored), 'flight')} ({minutes:.1f} minutes scored) and judged by {_basis(scored)}.",
        _comparison(choice, settings),
        _left_out(choice),
    ]
    worse = [one.name for one in ranked if one.status == "candidate" and one.worse_aims]
    if worse:
        sentences.append(f"Worse than now beyond doubt in one of these ways, and so not eligible: {_names(worse)}.")
    vetoed = [one.name for one in ranked if one.status == "vetoed"]
    if vetoed:
        sentences.append(f"Ruled out: {_names(vetoed)} (the table says why).")
    left_out = [flight.name for flight in flights if flight.evidence is None]
    if left_out:
        sentences.append(f"{_count(len(left_out), 'replayed flight')} could not be scored.")
    if choice.exploratory:
        sentences.append(
            f"This is exploratory: {_count(len(scored), 'flight')} cannot speak for the next one; "
            f"fly and add at least {settings.minimum_flights} before relying on it."
        )
    return " ".join(filter(None, sentences))


def _names(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMES
    return f"{', '.join(names[:_MOST_NAMES])} and {more} more" if more > 1 else ", ".join(names)


def _basis(flights: Sequence[AnalyzedFlight]) -> str:
    aims = {aim.name for flight in flights if flight.evidence is not None for aim in flight.evidence.aims}
    ways = []
    if AIDED in aims:
        ways.append("how well the estimator predicted each measurement before it saw it")
    if UNAIDED in aims:
        ways.append("how far the estimated velocity and position had drifted after seconds without GNSS")
    return " and ".join(ways)


def _comparison(choice: Choice, settings: DecisionSettings) -> str:
    best = choice.best
    if best is None:
        return "No other set was eligible for comparison."
    if choice.pick is not None:
        return _for_the_pick(choice.pick, best, settings)
    low, high = improvement_percent(best.upper), improvement_percent(best.lower)
    wins = f"better on {best.flights_better} of {best.flights} flights"
    if best.difference >= 0.0:
        percent, span = f"{-best.improvement_percent:.1f} %", _span(-high, -low, settings.confidence)
        return f"No other set did better; the nearest, “{best.name}”, has prediction errors {percent} larger ({span})."
    span = _span(low, high, settings.confidence)
    found = f"The best candidate, “{best.name}”, had errors {best.improvement_percent:.1f} % smaller ({span}; {wins}), "
    if best.upper >= 0.0:
        return (
            f"{found}but that interval includes no difference at all, so these flights do not show that a change "
            "would help."
        )
    p_value = best.p_holm if settings.multiplicity == "holm" else best.p_family
    return (
        f"{found}but the best of several candidates is favoured by chance, and after allowing for that "
        f"(p = {p_value:.2g}) the difference is not certain enough for a change."
    )


def _for_the_pick(pick: RankedSet, best: RankedSet, settings: DecisionSettings) -> str:
    span = _span(improvement_percent(pick.upper), improvement_percent(pick.lower), settings.confidence)
    wins = f"better on {pick.flights_better} of {pick.flights} flights"
    text = f"Its prediction errors are {pick.improvement_percent:.1f} % smaller than now ({span}; {wins})."
    if pick.name != best.name and is_proved(best, settings):
        text += (
            f" “{best.name}” did no better beyond its standard error ({best.improvement_percent:.1f} %) and lies "
            "further from what flies now."
        )
    elif pick.name != best.name:
        text += f" Those of “{best.name}” are {best.improvement_percent:.1f} % smaller, but not beyond chance."
    return text


def _left_out(choice: Choice) -> str:
    validated = choice.leave_one_out
    if validated is None or choice.best is None or validated.difference == 0.0:
        return ""
    gain = improvement_percent(validated.difference)
    better = "smaller" if gain >= 0.0 else "larger"
    count = len(validated.chosen)
    same = "whichever flight was left out" if validated.stays == count else f"in {validated.stays} of {count} cases"
    return (
        f"With each flight left out in turn, the best set of the others had errors {abs(gain):.1f} % {better} than now "
        f"on the one left out; it was the same set {same}."
    )


def _span(low: float, high: float, confidence: float) -> str:
    return f"{confidence:.0%} interval {low:+.1f} % to {high:+.1f} %".replace("-", "−")


def _no_evidence(flights: Sequence[AnalyzedFlight]) -> str:
    if not flights:
        return "Keep the parameters that fly now: no flight could be replayed, so nothing speaks for a change."
    reasons = "; ".join(f"{flight.name}: {flight.reason}" for flight in flights[:5])
    more = f"; and {len(flights) - 5} more" if len(flights) > 5 else ""
    return (
        "Keep the parameters that fly now: none of the "
        f"{_count(len(flights), 'replayed flight')} could be scored ({reasons}{more})."
    )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
