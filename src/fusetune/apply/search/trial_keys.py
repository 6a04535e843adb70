"""What is compared of flights in a search, and what the figures of a flight follow from beside base and set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.analyze.trials.tried_flight import TrialSettings
from fusetune.apply.settings import DecisionSettings
from fusetune.running.job_sources import TRIED
from fusetune.save.flight_folder import read_metadata
from fusetune.storage.digest import source_digest
from fusetune.storage.files import AnyPath
from fusetune.storage.ledger import key_of


def trial_settings(decision: DecisionSettings, analysis: AnalysisSettings) -> TrialSettings:
    """What is compared of each flight: what decides, and no more."""
    withheld = sorted({key.partition(".")[0] for key in decision.withheld_sources})
    return TrialSettings(analysis.replay, analysis.scoring, tuple(sorted(decision.sources)), tuple(withheld))


def made_of(folders: Mapping[str, AnyPath], trials: TrialSettings) -> dict[str, str]:
    """By saved flight: its log, the settings, the program."""
    program = source_digest(*TRIED)
    return {
        name: key_of([read_metadata(folder)["checksum"], program, asdict(trials)]) for name, folder in folders.items()
    }
