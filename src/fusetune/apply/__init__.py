"""The apply room: compares the parameter sets over all flights, decides, and writes what the vehicle loads."""
