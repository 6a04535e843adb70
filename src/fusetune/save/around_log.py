"""The study around what one log's vehicle flies, from the log alone."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from fusetune.design.around_present import AroundPresent, study_around
from fusetune.errors import UserError
from fusetune.save.exercise import exercise_of
from fusetune.save.log_folder import save_log
from fusetune.storage.files import AnyPath


def study_around_log(log: AnyPath, parameters: Sequence[str]) -> AroundPresent:
    """Sets around the values at the end of a log, of the parameters that its flight exercises.

    Raises
    ------
    UserError
        The log cannot be replayed, so no set could be tried on it.
    """
    with tempfile.TemporaryDirectory() as room:
        folder = Path(room) / "flight"
        verdict = save_log(log, folder)
        if verdict.status != "replayable":
            found = verdict.failures[0]
            raise UserError(log, found.found, found.remedy)
        flight = exercise_of(folder)
    return study_around(flight.parameters, parameters, [flight])
