"""When the filter updates, over which IMU interval, and which samples reach it then: made once, shared by replays."""
