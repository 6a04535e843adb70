"""How far the replay of a flight can be trusted, and how close one replay is to another.

`grade` gives a flight its grade and the reason, by the limits in `settings`; `grade_causes` finds what it costs;
`onboard_fidelity` writes both. `fidelity` compares a replay with another, such as PX4's own.
"""
