"""From the rate of the IMU to that of the filter (PX4 `EKF/imu_down_sampler/`)."""
