"""Slowly varying offsets of aid sources against the reference source, each a scalar Kalman filter."""
