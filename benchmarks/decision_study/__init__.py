"""Does the decision choose what the truth would have chosen? `python -m benchmarks.decision_study --help`."""
