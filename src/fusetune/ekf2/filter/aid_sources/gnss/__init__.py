"""GNSS: quality checks, velocity, position, height and dual-antenna heading."""
