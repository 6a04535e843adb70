"""Sensing systems judged by their covariances alone, before anything is built or flown: docs/covariance.md."""
