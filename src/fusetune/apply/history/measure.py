"""What a change does on a flight that came after it: the values before and after it replayed on the flight.

The values before are the set that the other is compared with, as when the change was decided: both are asked the same
question on flights that had no part in the answer.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from fusetune.analyze.evaluate import evaluate
from fusetune.analyze.flight_files import FIDELITY_FILE
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.scoring.score_flight import write_flight_scores
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.apply.history.entries import AFTER, BEFORE
from fusetune.save.flight_folder import load_flight
from fusetune.storage.files import AnyPath


def measure_change(
    flight_folder: AnyPath,
    fidelity: AnyPath,
    folder: AnyPath,
    before: Mapping[str, float],
    after: Mapping[str, float],
    replay: ReplaySettings,
    scoring: ScoringSettings,
) -> None:
    """Score the values before and after a change on a saved flight, into a folder like `results/analyze/<flight>`.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    fidelity : how far replays of the flight can be trusted, `results/analyze/<flight>/fidelity.json`

    Raises
    ------
    UserError
        If a file of the flight is missing or damaged.
    """
    prepared = prepare_flight(load_flight(flight_folder), replay)
    scores = evaluate(prepared, {BEFORE: before, AFTER: after}, present=BEFORE, settings=scoring)
    Path(folder).mkdir(parents=True, exist_ok=True)
    write_flight_scores(folder, scores)
    shutil.copyfile(fidelity, Path(folder) / FIDELITY_FILE)
