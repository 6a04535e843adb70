"""CPU seconds of a whole ranking and of its parts: ten flights, fifty sets, as many draws as are usual.

python benchmarks/decision_speed.py
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.choice import choose
from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED, AimEvidence, AnalyzedFlight, FlightEvidence
from fusetune.apply.ranking import rank
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.bootstrap import bootstrap_scores
from fusetune.apply.statistics.moderated import moderated
from fusetune.apply.statistics.sign_flips import family_p_values

FLIGHTS, SETS = 10, 50
BLOCKS = 12
"""Two minutes in blocks of 10 s."""


def flight(number: int) -> FlightEvidence:
    """Random block sums: three aided columns, fifteen unaided and three smoothed ones, as of a flight with GNSS."""
    generator = np.random.default_rng(number)
    aims = []
    for name, columns, samples in ((AIDED, 3, 50.0), (UNAIDED, 15, 2.0), (SMOOTHED, 3, 200.0)):
        nis = generator.chisquare(samples, (SETS, BLOCKS, columns))
        labels = tuple(f"column {index}" for index in range(columns))
        count = np.full((BLOCKS, columns), samples)
        aims.append(AimEvidence(name, 1 / 3, labels, np.full(columns, 1 / columns), count, nis, np.zeros_like(nis)))
    return FlightEvidence(f"flight {number}", tuple(f"set {index}" for index in range(SETS)), tuple(aims))


def main() -> None:
    """Print the times."""
    settings = DecisionSettings()
    evidence = [flight(number) for number in range(FLIGHTS)]
    sets = list(evidence[0].sets)
    differences = np.array([one.scores for one in evidence])
    differences = differences[:, 1:] - differences[:, :1]
    summary = {"sets": {name: {"same_results_as_present": False} for name in sets}}
    flights = [AnalyzedFlight(one.flight, Path(), summary, METRICS_SCHEMA.empty_table(), one) for one in evidence]
    for what, run in (
        (f"bootstrap, {settings.draws} draws", lambda: bootstrap_scores(evidence, sets, settings.draws, 0)),
        ("sign flips, both ways", lambda: family_p_values(np.hstack([differences, differences]), 0)),
        ("steadied spreads", lambda: moderated(differences)),
        ("ranking", lambda: rank(sets, sets[0], flights, {}, settings)),
        ("choice", lambda: choose(rank(sets, sets[0], flights, {}, settings), sets[0], evidence, {}, settings)),
    ):
        start = time.process_time()
        run()
        print(f"{FLIGHTS} flights x {SETS} sets, {what}: {time.process_time() - start:.2f} s of CPU")


if __name__ == "__main__":
    main()
