"""Choose PX4 EKF2 parameters from flight logs, without ground truth."""

__version__ = "0.1.0"
