"""The decision in words that a pilot understands."""

from collections.abc import Sequence

from fusetune.analyze.sources import AID_SOURCES
from fusetune.apply.choice import Choice
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.ranking import RankedSet, improvement_percent
from fusetune.apply.settings import DecisionSettings


def paragraph(
    choice: Choice, ranked: Sequence[RankedSet], flights: Sequence[AnalyzedFlight], settings: DecisionSettings
) -> str:
    """The decision, its evidence and its limits in a few sentences."""
    scored = [flight for flight in flights if flight.evidence is not None]
    if choice.status == "no_evidence":
        return _no_evidence(flights, settings)
    axes = scored[0].evidence.n.shape[1] if scored[0].evidence is not None else 1
    minutes = sum(flight.summary["scored_s"] for flight in scored) / 60.0
    label = AID_SOURCES[settings.source].label
    sentences = [
        f"Fly the set “{choice.chosen}”." if choice.status == "change" else "Keep the parameters that fly now.",
        f"{_count(len(ranked), 'parameter set')} {'was' if len(ranked) == 1 else 'were'} replayed on "
        f"{_count(len(scored), 'flight')} ({minutes:.1f} minutes scored) and judged by how well the estimator "
        f"predicted the {label} before it saw each measurement.",
        _comparison(choice, axes, label, settings),
    ]
    vetoed = [one.name for one in ranked if one.status == "vetoed"]
    if vetoed:
        sentences.append(f"Not eligible: {', '.join(vetoed)} (the table says why).")
    left_out = [flight.name for flight in flights if flight.evidence is None]
    if left_out:
        sentences.append(f"{_count(len(left_out), 'replayed flight')} could not be scored.")
    if choice.exploratory:
        sentences.append(
            f"This is exploratory: {_count(len(scored), 'flight')} cannot speak for the next one; "
            f"fly and add at least {settings.minimum_flights} before relying on it."
        )
    return " ".join(sentences)


def _comparison(choice: Choice, axes: int, label: str, settings: DecisionSettings) -> str:
    best = choice.best
    if best is None:
        return "No other set was eligible for comparison."
    low, high = improvement_percent(best.upper, axes), improvement_percent(best.lower, axes)
    span = _span(low, high, settings.confidence)
    wins = f"better on {best.flights_better} of {best.flights} flights"
    if choice.status == "change":
        percent = f"{best.improvement_percent:.1f} %"
        return f"Its prediction errors of the {label} are {percent} smaller than now ({span}; {wins})."
    if best.difference >= 0.0:
        percent, span = f"{-best.improvement_percent:.1f} %", _span(-high, -low, settings.confidence)
        return f"No other set did better; the nearest, “{best.name}”, has errors {percent} larger ({span})."
    if best.upper >= 0.0:
        return (
            f"The best candidate, “{best.name}”, had errors {best.improvement_percent:.1f} % smaller ({span}; {wins}), "
            "but that interval includes no difference at all, so these flights do not show that a change would help."
        )
    return (
        f"The best candidate, “{best.name}”, had errors {best.improvement_percent:.1f} % smaller ({span}; {wins}), but "
        f"the best of several candidates is favoured by chance, and after correcting for that (Holm, p = "
        f"{best.p_holm:.2g}) the difference is not certain enough for a change."
    )


def _span(low: float, high: float, confidence: float) -> str:
    return f"{confidence:.0%} interval {low:+.1f} % to {high:+.1f} %".replace("-", "−")


def _no_evidence(flights: Sequence[AnalyzedFlight], settings: DecisionSettings) -> str:
    label = AID_SOURCES[settings.source].label
    if not flights:
        return "Keep the parameters that fly now: no flight could be replayed, so nothing speaks for a change."
    reasons = "; ".join(f"{flight.name}: {flight.reason}" for flight in flights[:5])
    more = f"; and {len(flights) - 5} more" if len(flights) > 5 else ""
    return (
        "Keep the parameters that fly now: none of the "
        f"{_count(len(flights), 'replayed flight')} could be scored by the {label} ({reasons}{more})."
    )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
