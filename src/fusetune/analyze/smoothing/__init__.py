"""A smoothed reference of the velocity, from all of the flight, and how far each set's velocity is from it."""
