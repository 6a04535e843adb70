"""Sensors as models on the truth, with their noise and faults."""
