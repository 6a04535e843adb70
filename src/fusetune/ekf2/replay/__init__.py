"""A flight from its first to its last sample: the loop over the samples, what is recorded, how it starts, gaps."""
