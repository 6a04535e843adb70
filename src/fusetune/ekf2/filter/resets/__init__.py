"""Resets of states, and of the origin of the local frame."""
