"""A page per flight: what is wrong, since when, how sure, why, what to do."""
