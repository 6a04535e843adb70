"""What PX4's `EKF/` does, file by file: prediction, covariance, updates, control, resets, aid sources."""
