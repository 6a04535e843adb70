"""What a search tells of the parameters: which matter, which are flat; of all that it tried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fusetune.apply.search.outcome import Outcome
from fusetune.apply.search.search_trials import search_trials
from fusetune.apply.search.space import Space
from fusetune.apply.sensitivity.files import SENSITIVITY_FILE, write_sensitivity
from fusetune.apply.sensitivity.result import Sensitivity
from fusetune.apply.sensitivity.sensitivity import sensitivity
from fusetune.apply.sensitivity.wording import sentences
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.trials import Trials
from fusetune.apply.trials_file import TRIALS_FILE, write_trials
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class WhatMatters:
    """All that the search on all flights tried, and what that tells of the parameters; None where it tried nothing."""

    trials: Trials | None
    told: Sensitivity | None

    @property
    def sentences(self) -> Sequence[str]:
        """It in words."""
        return sentences(self.told) if self.told is not None else ()

    def write(self, folder: AnyPath) -> None:
        """Write both, in place of what the decision says of its two sets."""
        write_trials(Path(folder) / TRIALS_FILE, self.trials)
        write_sensitivity(Path(folder) / SENSITIVITY_FILE, self.told)


def what_matters(outcome: Outcome, space: Space, decision: DecisionSettings) -> WhatMatters:
    """What a search tells of its parameters."""
    found = outcome.found[0]
    trials = search_trials(space, outcome.asked, found, outcome.of_base)
    if trials is None:
        return WhatMatters(None, None)
    incumbent = [found.values[name] for name in trials.parameters]
    return WhatMatters(trials, sensitivity(trials, incumbent, confidence=decision.confidence, seed=decision.seed))
