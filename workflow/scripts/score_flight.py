"""Measure how well each set predicts the sensors of one flight, and how well the vehicle's own estimator did."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.onboard_fidelity import write_flight_fidelity
from fusetune.analyze.reconstruction import ReconstructionSettings
from fusetune.analyze.score_flight import score_flight
from fusetune.analyze.settings import ScoringSettings
from fusetune.analyze.start_choice import StartSettings
from fusetune.analyze.trust_settings import TrustSettings

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    flight, folder = Path(snakemake.input.flight), Path(snakemake.output[0]).parent
    score_flight(
        flight,
        folder,
        snakemake.params.sets,
        present=snakemake.params.present,
        settings=ScoringSettings.from_mapping(snakemake.params.scoring),
    )
    write_flight_fidelity(
        flight,
        folder,
        ReconstructionSettings.from_mapping(snakemake.params.reconstruction),
        StartSettings.from_mapping(snakemake.params.start),
        TrustSettings.from_mapping(snakemake.params.trust),
    )
