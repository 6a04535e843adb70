"""Names of the files that the analysis of a flight leaves beside its replays, whose names stand in `replaying.store`.

Rules of the workflow ask this module, too, so it imports nothing.
"""

from __future__ import annotations

SCORE_TABLES = {
    "metrics": "metrics.parquet",
    "blocks": "scores.parquet",
    "windows": "windows.parquet",
    "withheld": "withheld.parquet",
    "smoothed": "smoothed.parquet",
}
"""Table of `fusetune.analyze.scoring.score_sets.FlightScores` → its file."""

SAMPLES_FILE = "samples.parquet"
SCORING_FILE = "scoring.json"
DELAYS_FILE = "delays.json"
SENSOR_NOISE_FILE = "sensor_noise.json"
HEALTH_FILE = "health.json"
EFFECTS_FILE = "effects.json"
DIAGNOSIS_FILE = "diagnosis.json"
TRACK_FILE = "track.parquet"
CONFORMANCE_FILE = "conformance.json"
ONBOARD_FILE = "onboard.innovations.parquet"
FIDELITY_FILE = "fidelity.json"

KEPT_SCORES_FILE = ".scores.sqlite"
"""Scores of single sets, see `fusetune.analyze.scoring.kept_scores`; saves work, and is no result."""

DIAGNOSED_FILES = (HEALTH_FILE, EFFECTS_FILE, SENSOR_NOISE_FILE, DIAGNOSIS_FILE)
"""Of every flight that was saved, replayable or not."""

FLIGHT_FILES = (*SCORE_TABLES.values(), SAMPLES_FILE, SCORING_FILE, ONBOARD_FILE, FIDELITY_FILE)
