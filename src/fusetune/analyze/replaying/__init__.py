"""Parameter sets replayed on a flight, and the files of a replay."""
