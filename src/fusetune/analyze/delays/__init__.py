"""How late each sensor is, found from a flight, and which delays that PX4 is told are wrong."""
