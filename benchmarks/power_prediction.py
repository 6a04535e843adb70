"""Is a gain found as often as is predicted? Predicted from some flights of a world, observed on others of it.

`python -m benchmarks.power_prediction FOLDER [--draws N]` reads the judged flights of the decision study
(`FOLDER/<world>/<flight>`), and prints a table for docs/next_flights.md.

In every world each set whose score gains 3 to 30 % over all flights is one to be found. Flights are drawn; the rule
ranks all sets on them, and it is counted how often such a set is proved. Predicted is the chance of exactly that gain,
from the spread on eight other flights of the world than those drawn.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fusetune.apply.evidence import FlightEvidence, read_flights
from fusetune.apply.power.power import power_curve
from fusetune.apply.power.spread import spread_of
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.moderated import moderated
from fusetune.apply.statistics.sign_flips import family_p_values

BANDS = ((3.0, 7.0), (7.0, 14.0), (14.0, 35.0))
SIZES = (4, 5, 6, 8)
LEARNED = 8
SEED = 11


@dataclass(frozen=True)
class Compared:
    """Of one set of a world and a number of flights: the chance that was predicted, and how often it was found."""

    world: str
    name: str
    gain_percent: float
    flights: int
    predicted: float
    observed: float


def compare_world(folder: Path, draws: int) -> list[Compared]:
    """Predicted against observed in one world."""
    settings = DecisionSettings(seed=SEED)
    flights = read_flights(sorted(one for one in folder.iterdir() if one.is_dir()), settings, "present")
    evidence = [one.evidence for one in flights if one.evidence is not None]
    if len(evidence) < LEARNED + max(SIZES):
        return []
    names = ["present", *(name for name in evidence[0].sets if name != "present")]
    names = [name for name in names if all(name in one.sets for one in evidence)]
    differences = np.array([one.differences(names)[1:] for one in evidence])
    gains = -100.0 * np.expm1(differences.mean(axis=0))
    wanted = [index for index, gain in enumerate(gains) if BANDS[0][0] <= gain < BANDS[-1][1]]
    generator = np.random.default_rng(SEED)
    splits = [generator.permutation(len(evidence)) for _ in range(draws)]
    found = {size: np.zeros(len(wanted)) for size in SIZES}
    for order in splits:
        for size in SIZES:
            found[size] += proved(differences[order[LEARNED : LEARNED + size]], settings)[wanted] / draws
    predicted = _predictions([[evidence[i] for i in order[:LEARNED]] for order in splits[:4]], names, gains[wanted])
    return [
        Compared(folder.name, names[1 + index], float(gains[index]), size, predicted[place][size], found[size][place])
        for place, index in enumerate(wanted)
        for size in SIZES
    ]


def proved(differences: np.ndarray, settings: DecisionSettings) -> np.ndarray:
    """(C,) which sets the rule proves better in their whole score on flights (F, C)."""
    bounds = np.array([one.mean + one.reach(settings.confidence_of_a_change) for one in moderated(differences)])
    luck = family_p_values(differences, settings.seed) <= 1.0 - settings.confidence
    return (bounds < settings.smallest_gain) & luck


def _predictions(
    learned: Sequence[Sequence[FlightEvidence]], names: Sequence[str], gains: np.ndarray
) -> list[dict[int, float]]:
    """Chance of each gain by number of flights, the mean over some eights of flights."""
    settings = DecisionSettings(seed=SEED)
    spreads = [spread_of(one, names) for one in learned]
    rows = []
    for gain in gains:
        curves = [power_curve(one, float(gain), settings, numbers=SIZES, draws=80) for one in spreads if one]
        rows.append({size: float(np.mean([one.at(size) for one in curves])) for size in SIZES})
    return rows


def table(compared: Sequence[Compared]) -> str:
    """Markdown: predicted and observed by gain and number of flights."""
    lines = ["| gain in prediction errors | sets | " + " | ".join(f"{size} flights" for size in SIZES) + " |"]
    lines.append("| --- | --- |" + " --- |" * len(SIZES))
    for low, high in BANDS:
        own = [one for one in compared if low <= one.gain_percent < high]
        cells = []
        for size in SIZES:
            here = [one for one in own if one.flights == size]
            cells.append(f"{_percent([one.predicted for one in here])}, {_percent([one.observed for one in here])}")
        middle = np.median([one.gain_percent for one in own]) if own else math.nan
        count = len({(one.world, one.name) for one in own})
        lines.append(f"| {low:g} to {high:g} % (median {middle:.1f}) | {count} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _percent(shares: Sequence[float]) -> str:
    return f"{100.0 * float(np.mean(shares)):.0f}" if shares else "–"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--draws", type=int, default=40)
    options = parser.parse_args()
    worlds = sorted(one for one in options.folder.iterdir() if one.is_dir())
    with ProcessPoolExecutor(1) as pool:
        compared = [one for found in pool.map(compare_world, worlds, [options.draws] * len(worlds)) for one in found]
    print("Predicted, observed, % of draws in which such a set is found:\n")
    print(table(compared))
    errors = np.array([one.predicted - one.observed for one in compared])
    print(f"\nof {errors.size} sets and numbers: mean error {100 * errors.mean():+.0f} %, ", end="")
    print(f"mean size of the error {100 * np.abs(errors).mean():.0f} %")


if __name__ == "__main__":
    main()
