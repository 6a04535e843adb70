"""EKF-GSF: a bank of five small Kalman filters that finds the yaw from IMU and horizontal velocity alone."""
