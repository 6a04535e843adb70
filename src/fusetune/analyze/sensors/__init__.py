"""What the flight tells of the sensors themselves."""
