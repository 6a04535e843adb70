"""Runs of the pipeline beside and after each other: locks, recovery, jobs of a cluster."""
