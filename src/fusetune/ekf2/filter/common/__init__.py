"""What all parts of the filter share: memory, state, status, time, parameters (PX4's `common.h`, `ekf_helper.cpp`)."""
