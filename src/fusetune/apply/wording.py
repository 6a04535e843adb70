"""The decision in words that a pilot understands."""

from collections.abc import Iterator, Sequence

from fusetune.apply.choice import Choice
from fusetune.apply.evidence import (
    AIDED,
    DISTRUSTED,
    MISLEADING,
    NOT_SCORED,
    SMOOTHED,
    UNAIDED,
    WITHOUT_SAMPLES,
    AnalyzedFlight,
)
from fusetune.apply.ranking import RankedSet, gains_enough, improvement_percent
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
        f"{counted(len(ranked), 'parameter set')} {'was' if len(ranked) == 1 else 'were'} replayed on "
        f"{counted(len(scored), 'flight')} ({minutes:.1f} minutes scored) and judged by {_basis(scored)}.",
        _comparison(choice, ranked, settings),
        _left_out(choice),
        *_not_eligible(ranked),
        *_not_counted(flights, settings),
    ]
    if choice.exploratory:
        sentences.append(
            f"This is exploratory: {counted(len(scored), 'flight')} cannot speak for the next one; "
            f"fly and add at least {settings.minimum_flights} before relying on it."
        )
    return " ".join(filter(None, sentences))


def _not_eligible(ranked: Sequence[RankedSet]) -> Iterator[str]:
    worse = [one.name for one in ranked if one.worse_aims and not one.is_vetoed]
    if worse:
        yield f"Worse than now beyond doubt in one of these ways, and so not eligible: {named(worse)}."
    vetoed = [one.name for one in ranked if one.is_vetoed]
    if vetoed:
        yield f"Ruled out, and so not eligible: {named(vetoed)} (the table says why)."
    never = [one.name for one in ranked if not one.flights]
    if never:
        yield f"Scored on no flight: {named(never)} (the table says why)."


def _not_counted(flights: Sequence[AnalyzedFlight], settings: DecisionSettings) -> Iterator[str]:
    """Flights that had no say, by what kept them out."""
    lowest = settings.lowest_grade
    for kind, one, more in (
        (NOT_SCORED, "could not be scored", "could not be scored"),
        (
            DISTRUSTED,
            f"does not count, as its replay has a trust grade below {lowest}",
            f"do not count, as their replays have trust grades below {lowest}",
        ),
        (WITHOUT_SAMPLES, "has nothing that sets are judged by", "have nothing that sets are judged by"),
        (MISLEADING, "has nothing that can be trusted to tell sets apart", "have nothing that can be trusted to"),
    ):
        count = sum(flight.without is not None and flight.without.kind == kind for flight in flights)
        if count:
            yield f"{counted(count, 'replayed flight')} {one if count == 1 else more}."


def named(names: Sequence[str], most: int = _MOST_NAMES) -> str:
    """Names in a sentence, of many the first."""
    more = len(names) - most
    return f"{', '.join(names[:most])} and {more} more" if more > 1 else ", ".join(names)


def _basis(flights: Sequence[AnalyzedFlight]) -> str:
    aims = {aim.name for flight in flights if flight.evidence is not None for aim in flight.evidence.aims if aim.weight}
    ways = []
    if AIDED in aims:
        ways.append("how well the estimator predicted each measurement before it saw it")
    if UNAIDED in aims:
        ways.append("how far the estimated velocity and position had drifted after seconds without GNSS")
    if SMOOTHED in aims:
        ways.append("how near its velocity came to the one that the whole flight, before and after, makes likely")
    return " and ".join(filter(None, (", ".join(ways[:-1]), *ways[-1:])))


def _comparison(choice: Choice, ranked: Sequence[RankedSet], settings: DecisionSettings) -> str:
    best = choice.best
    if best is None:
        same = [one.name for one in ranked if one.equal_to_present]
        if same and len(same) == len(ranked) - 1:
            return "All other sets gave the same results as these."
        return "No other set was eligible for comparison." if len(ranked) > 1 else "There was no other set to compare."
    if choice.pick is not None and choice.mends_delays:
        return _for_the_mended(choice, choice.pick, settings)
    if choice.pick is not None:
        return _for_the_pick(choice.pick, best, settings)
    if best.difference >= 0.0:
        size = f"{-best.improvement_percent:.1f} % larger"
        if best.difference == 0.0:
            return f"No other set did better; the nearest, “{best.name}”, has the same prediction errors."
        span = _larger(best.lower, best.upper, settings.confidence)
        return f"No other set did better; the nearest, “{best.name}”, has prediction errors {size} ({span})."
    wins = f"better on {best.flights_better} of {counted(best.flights, 'flight')}"
    found = f"The best candidate, “{best.name}”, had errors {best.improvement_percent:.1f} % smaller "
    if best.upper is None:
        return f"{found}({wins}), but {UNKNOWN_INTERVAL}: nothing in these flights shows how it varies."
    found += f"({smaller(best.lower, best.upper, settings.confidence)}; {wins}), "
    if best.upper >= 0.0:
        return (
            f"{found}but that interval includes no difference at all, so these flights do not show that a change "
            "would help."
        )
    if best.bound is not None and not gains_enough(best, settings):
        return (
            f"{found}but a change is made only for a gain that matters, at least "
            f"{settings.smallest_gain_percent:g} % beyond doubt."
        )
    p_value = best.p_holm if settings.multiplicity == "holm" else best.p_family
    if p_value is None:
        return f"{found}but one flight cannot show whether the best of several candidates is only favoured by chance."
    return (
        f"{found}but the best of several candidates is favoured by chance, and after allowing for that "
        f"(p = {p_value:.2g}) the difference is not certain enough for a change."
    )


def _for_the_mended(choice: Choice, pick: RankedSet, settings: DecisionSettings) -> str:
    """Why a set with mended delays is chosen: what is measured is proof enough if the predictions do not contradict."""
    wins = f"better on {pick.flights_better} of {counted(pick.flights, 'flight')}"
    span = smaller(pick.lower, pick.upper, settings.confidence)
    text = f"Its prediction errors are {pick.improvement_percent:.1f} % smaller than now ({span}; {wins})."
    beyond = choice.beyond_mending
    if beyond is None:
        return f"{text} With the delay mended, no other set is proved better still."
    span = smaller(beyond.lower, beyond.upper, settings.confidence)
    return (
        f"{text} They are {beyond.improvement_percent:.1f} % smaller than with nothing but the delay mended ({span}; "
        f"better on {beyond.flights_better} of {counted(beyond.flights, 'flight')})."
    )


def _for_the_pick(pick: RankedSet, best: RankedSet, settings: DecisionSettings) -> str:
    span = smaller(pick.lower, pick.upper, settings.confidence)
    wins = f"better on {pick.flights_better} of {counted(pick.flights, 'flight')}"
    text = f"Its prediction errors are {pick.improvement_percent:.1f} % smaller than now ({span}; {wins})."
    if not gains_enough(pick, settings):
        nearer = pick.aims[SMOOTHED]
        text += (
            " That alone would not be enough for a change; but its velocity is "
            f"{improvement_percent(nearer.difference):.1f} % nearer to the one that the whole flight, before and "
            f"after, makes likely ({smaller(nearer.lower, nearer.upper, settings.confidence)})."
        )
    if pick.name != best.name and gains_enough(best, settings):
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


UNKNOWN_INTERVAL = "how far chance could do that is not known"


def smaller(lower: float | None, upper: float | None, confidence: float) -> str:
    """Interval of a difference of scores as a reduction of the errors."""
    if lower is None or upper is None:
        return UNKNOWN_INTERVAL
    return _span(improvement_percent(upper), improvement_percent(lower), confidence)


def _larger(lower: float | None, upper: float | None, confidence: float) -> str:
    """Interval of a difference of scores as a growth of the errors."""
    if lower is None or upper is None:
        return UNKNOWN_INTERVAL
    return _span(-improvement_percent(lower), -improvement_percent(upper), confidence)


def _span(low: float, high: float, confidence: float) -> str:
    return f"{confidence:.0%} interval {low:+.1f} % to {high:+.1f} %".replace("-", "−")


def _no_evidence(flights: Sequence[AnalyzedFlight]) -> str:
    if not flights:
        return "Keep the parameters that fly now: no flight could be replayed, so nothing speaks for a change."
    reasons = "; ".join(f"{flight.name}: {flight.reason}" for flight in flights[:5])
    more = f"; and {len(flights) - 5} more" if len(flights) > 5 else ""
    if len(flights) == 1:
        return f"Keep the parameters that fly now: the one replayed flight has no say ({reasons})."
    return f"Keep the parameters that fly now: none of the {len(flights)} replayed flights has a say ({reasons}{more})."


def counted(number: int, noun: str) -> str:
    """A number of things, with the plural's s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
