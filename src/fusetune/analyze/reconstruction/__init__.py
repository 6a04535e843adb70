"""Gives the estimator back what the logger left out: IMU rows, magnetometer and barometer samples; never GNSS."""

from fusetune.analyze.reconstruction.measured import measured_rows
from fusetune.analyze.reconstruction.reconstructed_flight import (
    RECONSTRUCTION_TOPICS,
    ReconstructedFlight,
    Step,
    as_logged,
    reconstruct,
)
from fusetune.analyze.reconstruction.settings import ReconstructionSettings

__all__ = [
    "RECONSTRUCTION_TOPICS",
    "ReconstructedFlight",
    "ReconstructionSettings",
    "Step",
    "as_logged",
    "measured_rows",
    "reconstruct",
]
