"""The home of a replay's files: their names (`parts`), what they hold (`columns`), how they are written and read."""
