"""Put the verdicts of all flights into one table, and write down what the vehicle flies now."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.trust.settings import TrustSettings, reaches
from fusetune.running.job import keep_out, logged_job
from fusetune.save import find_present, write_flights_table, write_present
from fusetune.save.discovery import RefusedEntry
from fusetune.settings.declaration import built

if TYPE_CHECKING:
    snakemake: Any


def counts(flight: str) -> bool:
    """Whether the replay of a flight is trusted enough to decide."""
    # most runs need not ask, and so need not load the estimator
    from fusetune.analyze.analyze_flight import AnalysisSettings, grade_saved_flight

    replay, trust = built(ReplaySettings, snakemake.params.replay), TrustSettings(**snakemake.params.trust)
    grade = grade_saved_flight(folders[flight], AnalysisSettings(replay=replay, trust=trust))
    taken = reaches(grade.grade if grade.is_compared else None, snakemake.params.lowest_grade)
    print(f"{flight}: grade {grade.grade}, {'counts' if taken else 'does not count'}")
    return taken


keep_out("pandas")
with logged_job(snakemake.log[0]):
    params, folders = snakemake.params, {Path(folder).name: Path(folder) for folder in snakemake.input.folders}
    refused = [RefusedEntry(*entry) for entry in params.refused]
    rows = write_flights_table(
        list(folders.values()), snakemake.output.table, snakemake.output.csv, refused, snakemake.output.checks
    )
    present = find_present(rows, folders, params.varied, params.present_flight, params.vehicle, counts, params.around)
    write_present(snakemake.output.present, present)
    print(*(f"no set {name}: {why}" for name, why in present.left_out.items()), sep="\n")
