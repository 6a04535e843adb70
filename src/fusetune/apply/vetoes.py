"""What rules a set out however well it scores: failures, resets, lost sources, faults, breaks, values out of range.

A veto asks for evidence like everything else: events are counts, and a count is held against a set where its rate is
larger than the present set's beyond doubt. As what happens on one flight often happens there in a row, it must be so on
more than one flight, where there are more than one.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.analyze.metrics.break_rate import clopper_pearson
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.rates import rate_ratio
from fusetune.px4.aid_sources import AXES
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, check_by, metadata_of
from fusetune.storage.words import texts

FEWEST_FLIGHTS = 2
"""On so many flights, or on all where there are fewer, a set must do worse for it to be held against it."""

LASTING_PERCENT = 1.0
"""Of the time in flight, beyond the present set's share: so long a fault is no passing one."""

CONDITIONS = ("fs_bad_acc_vertical", "fs_bad_acc_clipping")
"""Fault flags that tell of the flight: vertical accelerations that contradict the heights, and clipping of the IMU. The
filter answers the first with more noise and goes on; too small a noise raises it, so it counts where it lasts longer
than with the present set. Clipping is counted in the IMU samples, the same for all sets, and never counts. All other
flags (`fs_bad_mag_*`, `fs_bad_hdg`, …) say that an innovation variance fell below that of its observation: a covariance
that is no longer one, which the filter throws away."""

_SAME_FOR_ALL = "fs_bad_acc_clipping"


EventPairs = Mapping[str, tuple[Mapping[str, Any], Mapping[str, Any]]]
"""Flight → what its summary says of the set and of the present one: `flight_s`, `significant_resets`, `timeouts`,
`fault_s`, and `reset_jumps` where these are known."""

BreakRates = Mapping[tuple[str, str, str, str], tuple[float, float]]
"""Set, source, axis and flight → break rate and number of samples."""


def vetoes(
    name: str,
    present: str,
    flights: Sequence[AnalyzedFlight],
    rates: Mapping[str, BreakRates],
    settings: DecisionSettings,
) -> list[str]:
    """Reasons in words against a set; empty where there are none.

    Parameters
    ----------
    flights : all analysed flights; those that the present set could not be scored on count for nobody
    rates : of each set its own, as `break_rates` finds them
    """
    scored = [flight for flight in flights if flight.evidence is not None]
    reasons = _failures(name, scored, settings)
    pairs = {
        flight.name: (own, flight.summary["sets"][present])
        for flight in scored
        if (own := flight.summary["sets"].get(name)) is not None
    }
    reasons += event_reasons(pairs, settings)
    reasons += _out_of_range(name, flights)
    names = [flight.name for flight in scored]
    both = {**rates.get(present, {}), **rates.get(name, {})}
    return reasons + break_reasons(name, present, names, both, settings.confidence)


def event_reasons(pairs: EventPairs, settings: DecisionSettings) -> list[str]:
    """What the filter did beside fusing that speaks against a set."""
    return [*_faults(pairs), *_resets(pairs, settings), *_lost_sources(pairs, settings)]


def _failures(name: str, flights: Sequence[AnalyzedFlight], settings: DecisionSettings) -> list[str]:
    counting = {key.partition(".")[0] for key in (*settings.sources, *settings.withheld_sources)}
    reasons = []
    for flight in flights:
        assert flight.evidence is not None
        if name not in flight.evidence.row:
            summary = flight.summary["sets"].get(name, {})
            left_out = summary.get("evidence", {}).get("left_out", {})
            lacks = "; ".join(why for source, why in sorted(left_out.items()) if source in counting)
            unknown = "not scored on the same samples as the present set, or with errors that are no numbers"
            reasons.append(f"{flight.name}: {summary.get('reason') or lacks or unknown}")
    return reasons


def _resets(pairs: EventPairs, settings: DecisionSettings) -> Iterator[str]:
    """Resets that moved the state far; small ones are no worse than a fused measurement."""
    counts = {flight: tuple(one["significant_resets"] for one in both) for flight, both in pairs.items()}
    if _is_more(counts, pairs, settings):
        own, base = _totals(counts)
        yield f"{own} resets that moved the state far{_largest_jumps(pairs)}, the present set has {base}"


def _lost_sources(pairs: EventPairs, settings: DecisionSettings) -> Iterator[str]:
    counts = {flight: tuple(sum(one["timeouts"].values()) for one in both) for flight, both in pairs.items()}
    if _is_more(counts, pairs, settings):
        own, base = _totals(counts)
        yield f"{own} lost aid sources, the present set has {base}"


def _is_more(counts: Mapping[str, tuple[int, ...]], pairs: EventPairs, settings: DecisionSettings) -> bool:
    """Whether events are more frequent than with the present set, beyond doubt and on enough flights."""
    worse = sum(own > base for own, base in counts.values())
    if worse < min(FEWEST_FLIGHTS, len(counts)) or not worse:
        return False
    own, base = _totals(counts)
    exposure, base_exposure = (sum(both[place]["flight_s"] for both in pairs.values()) for place in (0, 1))
    if not (exposure > 0.0 and base_exposure > 0.0):
        return False
    return rate_ratio(own, exposure, base, base_exposure, settings.confidence).is_larger


def _totals(counts: Mapping[str, tuple[int, ...]]) -> tuple[int, int]:
    return sum(own for own, _ in counts.values()), sum(base for _, base in counts.values())


def _largest_jumps(pairs: EventPairs) -> str:
    """The largest jump of the set in each unit, in words."""
    largest: dict[str, float] = {}
    for own, _ in pairs.values():
        for jumps in own.get("reset_jumps", {}).values():
            if jumps["largest"] is not None:
                largest[jumps["unit"]] = max(largest.get(jumps["unit"], 0.0), jumps["largest"])
    told = ", ".join(f"{size:.2g} {unit}" for unit, size in largest.items())
    return f" (by up to {told})" if told else ""


def _faults(pairs: EventPairs) -> Iterator[str]:
    """Fault flags in flight that the present set has not, or by far not so long."""
    names = sorted({fault for own, _ in pairs.values() for fault in own["fault_s"]} - {_SAME_FOR_ALL})
    for fault in names:
        shares = {flight: tuple(_share_percent(one, fault) for one in both) for flight, both in pairs.items()}
        lasting = [flight for flight, (own, base) in shares.items() if own - base > LASTING_PERCENT]
        new = [flight for flight, (own, base) in shares.items() if own > 0.0 and base == 0.0]
        several = min(FEWEST_FLIGHTS, len(pairs))
        if fault in CONDITIONS:
            held = lasting if len(lasting) >= several else []
        else:
            held = lasting or (new if len(new) >= FEWEST_FLIGHTS else [])
        if held:
            seconds = sum(pairs[flight][0]["fault_s"][fault] for flight in held)
            yield f"filter fault {fault} on {', '.join(held)} ({seconds:.3g} s)"


def _share_percent(summary: Mapping[str, Any], fault: str) -> float:
    seconds = summary["fault_s"].get(fault, 0.0)
    return 100.0 * seconds / summary["flight_s"] if summary["flight_s"] > 0.0 else 0.0


def _out_of_range(name: str, flights: Sequence[AnalyzedFlight]) -> list[str]:
    reasons = []
    for flight in flights:
        overrides = flight.summary["sets"].get(name, {}).get("overrides", {})
        for parameter, value in sorted(overrides.items()):
            try:
                check_by(ALL_PARAMETERS.get(parameter) or metadata_of(parameter), value)
            except ValueError as error:
                reasons.append(str(error))
        if overrides:
            break
    return reasons


def break_rates(metrics: pa.Table) -> Mapping[str, BreakRates]:
    """Set → its break rates, of the figures of all flights (columns of `METRICS_SCHEMA`)."""
    wanted = pc.and_(
        pc.equal(metrics["metric"], "break_rate_gate"), pc.is_in(metrics["axis"], value_set=pa.array(AXES))
    )
    rates: dict[str, dict[tuple[str, str, str, str], tuple[float, float]]] = {}
    kept = metrics.filter(wanted)
    keys = zip(*(texts(kept[name]) for name in ("set", "source", "axis", "flight")), strict=True)
    for key, value, samples in zip(keys, kept["value"].to_pylist(), kept["n"].to_pylist(), strict=True):
        if math.isfinite(value) and samples > 0:
            rates.setdefault(key[0], {})[key] = (value, samples)
    return rates


def break_reasons(name: str, present: str, flights: Sequence[str], rates: BreakRates, confidence: float) -> list[str]:
    """A break rate is held against a set where its interval lies wholly above that of the present set.

    The level of the intervals allows for the number of flights, sources and axes that are looked at (Bonferroni).
    """
    compared = [
        place for one, *place in sorted(rates) if one == name and place[2] in flights and (present, *place) in rates
    ]
    confidence = 1.0 - (1.0 - confidence) / max(len(compared), 1)
    reasons = []
    for source, axis in dict.fromkeys((source, axis) for source, axis, _ in compared):
        there = [flight for *place, flight in compared if place == [source, axis]]
        figures = [[rates[one, source, axis, flight] for one in (name, present)] for flight in there]
        worse = [pair for pair in figures if _interval(pair[0], confidence)[0] > _interval(pair[1], confidence)[1]]
        if worse and len(worse) >= min(FEWEST_FLIGHTS, len(there)):
            own, base = (100.0 * np.mean([pair[place][0] for pair in worse]) for place in (0, 1))
            reasons.append(
                f"on {len(worse)} of {len(there)} flights {own:.1f} % of {source} {axis} beyond the gate, "
                f"the present set has {base:.1f} % there"
            )
    return reasons


# the present set's are asked for beside every other's
@lru_cache(maxsize=4096)
def _interval(rate: tuple[float, float], confidence: float) -> tuple[float, float]:
    share, samples = rate
    bounds = clopper_pearson(round(share * samples), round(samples), confidence)
    return float(bounds.lower), float(bounds.upper)
