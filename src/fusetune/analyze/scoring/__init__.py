"""All sets of a flight on the same measurements: window, alignment, scores, tables."""
