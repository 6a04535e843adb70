"""Rotations, geodesy and the earth as kernels; they know nothing of the filter."""
