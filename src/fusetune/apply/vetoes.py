"""What rules a set out however well it scores: faults, resets, lost sources, breaks, values out of range."""

from collections.abc import Sequence

import pyarrow as pa
import pyarrow.compute as pc

from fusetune.apply.evidence import AnalyzedFlight
from fusetune.px4.aid_sources import AXES
from fusetune.px4.parameters.ekf2_parameters import check_value


def vetoes(name: str, present: str, flights: Sequence[AnalyzedFlight], metrics: pa.Table) -> list[str]:
    """Reasons in words against a set; empty where there are none.

    Parameters
    ----------
    flights : all analysed flights; those that the present set could not be scored on count for nobody
    metrics : the figures of all flights (columns of `METRICS_SCHEMA`)
    """
    scored = [flight for flight in flights if flight.evidence is not None]
    reasons = _failures(name, scored) + _events(name, present, scored) + _out_of_range(name, flights)
    return reasons + _breaks(name, present, [flight.name for flight in scored], metrics)


def _failures(name: str, flights: Sequence[AnalyzedFlight]) -> list[str]:
    reasons = []
    for flight in flights:
        assert flight.evidence is not None
        if name not in flight.evidence.sets:
            why = flight.summary["sets"].get(name, {}).get("reason")
            unknown = "not scored on the same samples as the present set, or with errors that are no numbers"
            reasons.append(f"{flight.name}: {why or unknown}")
    return reasons


def _events(name: str, present: str, flights: Sequence[AnalyzedFlight]) -> list[str]:
    totals = {"resets": [0, 0], "timeouts": [0, 0]}
    faults: set[str] = set()
    for flight in flights:
        one, base = flight.summary["sets"].get(name), flight.summary["sets"][present]
        if one is None:
            continue
        for kind, total in totals.items():
            total[0] += sum(one[kind].values())
            total[1] += sum(base[kind].values())
        faults |= {f"{fault} on {flight.name}" for fault in set(one["faults"]) - set(base["faults"])}
        if one["fault_flags"] and not base["fault_flags"] and not set(one["faults"]) - set(base["faults"]):
            faults.add(f"fault flags {one['fault_flags']} on {flight.name}")
    reasons = [f"filter fault {fault}" for fault in sorted(faults)]
    words = {"resets": "resets", "timeouts": "lost aid sources"}
    for kind, (own, base) in totals.items():
        if own > base:
            reasons.append(f"{own} {words[kind]}, the present set has {base}")
    return reasons


def _out_of_range(name: str, flights: Sequence[AnalyzedFlight]) -> list[str]:
    reasons = []
    for flight in flights:
        overrides = flight.summary["sets"].get(name, {}).get("overrides", {})
        for parameter, value in sorted(overrides.items()):
            try:
                check_value(parameter, value)
            except ValueError as error:
                reasons.append(str(error))
        if overrides:
            break
    return reasons


def _breaks(name: str, present: str, flights: Sequence[str], metrics: pa.Table) -> list[str]:
    """A break rate is held against a set where its interval lies wholly above that of the present set."""
    rows = metrics.filter(
        pc.and_(
            pc.equal(metrics["metric"], "break_rate_gate"),
            pc.is_in(metrics["axis"], value_set=pa.array(AXES)),
        )
    ).to_pylist()
    figures = {(row["flight"], row["set"], row["source"], row["axis"]): row for row in rows}
    reasons = []
    for (flight, set_name, source, axis), row in sorted(figures.items()):
        base = figures.get((flight, present, source, axis))
        if set_name == name and flight in flights and base is not None and row["lower"] > base["upper"]:
            reasons.append(
                f"{flight}: {100 * row['value']:.1f} % of {source} {axis} beyond the gate, "
                f"the present set has {100 * base['value']:.1f} %"
            )
    return reasons
