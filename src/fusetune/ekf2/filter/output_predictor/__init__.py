"""The state at the newest IMU sample, ahead of the fusion time horizon (PX4 `EKF/output_predictor/`)."""
