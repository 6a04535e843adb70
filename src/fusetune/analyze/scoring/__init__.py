"""All sets of a flight on the same measurements: window, alignment, scores, tables.

Figures of every source and axis, and block sums; the one score of a set, by which it is ranked, is made of these sums
over all flights in `fusetune.apply` (`evidence`, `ranking`).
"""
