"""How many flights it takes to say something of a fleet, and how sure of it is what is said."""

LEVEL = 0.05
"""Chance that anything is named at all in a fleet in which nothing changes, for steps and for drifts each."""
FEWEST_A_SIDE = 3
"""A change shows in so many flights before and after; of fewer it is an outlier."""
FEWEST_FLIGHTS = 10
"""Of fewer flights the spread is too little known for one of them to stand out."""
FALSE_SHARE = 0.05
"""Of flights that are named as unlike the others, at most so much is chance."""
