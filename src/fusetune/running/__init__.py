"""Runs of the pipeline: how one is started and followed, locks, recovery, jobs of a cluster."""
