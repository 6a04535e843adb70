"""Effects that a parameter of PX4 describes, estimated from a flight: value with interval, or why it does not tell."""
