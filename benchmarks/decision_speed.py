"""CPU seconds of the bootstrap and of a whole ranking: ten flights, fifty sets, 2,000 draws.

python benchmarks/decision_speed.py
"""

from __future__ import annotations

import time

import numpy as np

from fusetune.apply.evidence import AIDED, UNAIDED, AimEvidence, FlightEvidence
from fusetune.apply.statistics.bootstrap import bootstrap_scores
from fusetune.apply.statistics.sign_flips import family_p_values

FLIGHTS, SETS, DRAWS = 10, 50, 2000
BLOCKS = 12
"""Two minutes in blocks of 10 s."""


def flight(number: int) -> FlightEvidence:
    """Random block sums: three aided columns, fifteen unaided ones, as of a flight with GNSS."""
    generator = np.random.default_rng(number)
    aims = []
    for name, columns, samples in ((AIDED, 3, 50.0), (UNAIDED, 15, 2.0)):
        nis = generator.chisquare(samples, (SETS, BLOCKS, columns))
        labels = tuple(f"column {index}" for index in range(columns))
        count = np.full((BLOCKS, columns), samples)
        aims.append(AimEvidence(name, 0.5, labels, np.full(columns, 1 / columns), count, nis, np.zeros_like(nis)))
    return FlightEvidence(f"flight {number}", tuple(f"set {index}" for index in range(SETS)), tuple(aims))


def main() -> None:
    """Print the times."""
    flights = [flight(number) for number in range(FLIGHTS)]
    start = time.process_time()
    bootstrap_scores(flights, list(flights[0].sets), DRAWS, 0)
    print(f"bootstrap, {DRAWS} draws of {FLIGHTS} flights x {SETS} sets: {time.process_time() - start:.2f} s of CPU")
    scores = np.array([one.scores for one in flights])
    start = time.process_time()
    family_p_values(scores[:, 1:] - scores[:, :1], 0)
    print(f"sign flips: {time.process_time() - start:.3f} s of CPU")


if __name__ == "__main__":
    main()
