"""Effects that are estimated from logs, and how well they hold where the truth is known: docs/effects.md.

python -m benchmarks.effect_estimates LOG.ulg … STUDY/*/*/fault.json

Beside a `fault.json`, whose `truth` holds the true values by name, lies its log. Of these a table is printed at the
end: how often each value was told, how often its interval holds the truth, median error and half-width; and the CPU.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fusetune.analyze.effects.all_effects import all_effects
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
from fusetune.errors import UserError
from fusetune.px4.ulog.reader import read_ulog

GAUSS_PER_A_IN_GAUSS_PER_KA = 1e3


@dataclass
class Table:
    """Estimates beside their truth, and what they cost."""

    rows: dict[str, list[tuple[float, Estimate]]] = field(default_factory=dict)
    flights: int = 0
    known: int = 0
    motion_s: float = 0.0
    effects_s: float = 0.0
    minutes: float = 0.0

    def add(self, effects: Sequence[Effect], truth: Mapping[str, float]) -> None:
        """Estimates of one flight whose truth is known."""
        self.known += 1
        for effect in effects:
            for one in effect.estimates:
                if one.name in truth:
                    self.rows.setdefault(one.name, []).append((truth[one.name], one))

    def lines(self) -> list[str]:
        """As a table of Markdown."""
        found = ["| estimate | told | held | median error | half of the interval, median |", "|---|---|---|---|---|"]
        for name, pairs in self.rows.items():
            error = np.median([abs(one.value - true) for true, one in pairs])
            half = np.median([0.5 * (one.upper - one.lower) for _, one in pairs])
            held = np.mean([one.lower <= true <= one.upper for true, one in pairs])
            found.append(f"| {name} | {len(pairs)} of {self.known} | {100 * held:.0f} % | {error:.4g} | {half:.4g} |")
        return found


def true_values(document: Mapping[str, float]) -> dict[str, float]:
    """Truth by the names of the estimates."""
    found = dict(document)
    for axis in "xyz":
        found[f"hard_iron_{axis}"] = document.get(f"hard_iron_{axis}_gauss", np.nan)
        per_a = document.get(f"motor_field_{axis}_gauss_per_a", np.nan)
        found[f"motor_field_{axis}"] = GAUSS_PER_A_IN_GAUSS_PER_KA * per_a
    for name, parameter in (("flow_scale", "SENS_FLOW_SCALE"), ("airspeed_scale", "ASPD_SCALE_1")):
        found[parameter] = 1.0 / document.get(name, np.nan)
    return {name: value for name, value in found.items() if np.isfinite(value)}


def estimate(log: Path, table: Table) -> tuple[Effect, ...]:
    """Effects of a log; what they cost beside its replay is added to the table."""
    flight = read_ulog(log)
    observed = ObservedFlight(flight)
    observed.replayed  # noqa: B018 - made before the clock runs
    begin = time.process_time()
    observed.motion  # noqa: B018
    between = time.process_time()
    effects = all_effects(observed)
    table.motion_s += between - begin
    table.effects_s += time.process_time() - between
    table.minutes += flight.duration_s / 60.0
    table.flights += 1
    return effects


def main(arguments: Sequence[str] | None = None) -> None:
    """Estimate, print, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("paths", nargs="+", type=Path, help="logs, or fault.json beside them")
    use_kernel_cache()
    table = Table()
    for path in parser.parse_args(arguments).paths:
        is_known = path.suffix == ".json"
        log = next(path.parent.glob("*.ulg"), path) if is_known else path
        try:
            effects = estimate(log, table)
        except UserError as error:
            print(error)
            continue
        if is_known:
            table.add(effects, true_values(json.loads(path.read_text())["truth"]))
            continue
        print(f"{log.name}:")
        for effect in effects:
            print(f"  {effect.id}: {effect.refusal}" if effect.refusal else f"  {effect.id}")
            for one in effect.estimates:
                told = "" if one.told is None else f", told {one.told:g}"
                print(f"    {one.name} {one.value:.4g} [{one.lower:.4g}, {one.upper:.4g}] {one.unit}{told}")
    if table.rows:
        print("\n".join(table.lines()))
    if table.minutes:
        motion, effects_s = (one / table.minutes for one in (table.motion_s, table.effects_s))
        print(
            f"{table.flights} flights; a minute costs {motion:.3f} s of CPU for motion, {effects_s:.3f} s for effects"
        )


if __name__ == "__main__":
    main()
