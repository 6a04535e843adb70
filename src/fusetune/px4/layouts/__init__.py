"""Logs of every release in the layout of v1.16: topics, estimator instances, the vehicle's own state."""
