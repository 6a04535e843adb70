"""From messages to the samples that the filter takes (PX4's `EKF2.cpp` and `RingBuffer.h`)."""
