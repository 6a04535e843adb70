"""Logs of every release in the layout of v1.16: topics, estimator instances, the vehicle's own state.

Ordered by topic, not by release, for a topic rarely changes: `release_layouts.canonical` gives the flight, the function
named like a topic in `sensor_layouts` says what that had otherwise. What a log of one release looks like is made in
`tests/save/test_old_and_new_logs.py`.
"""
