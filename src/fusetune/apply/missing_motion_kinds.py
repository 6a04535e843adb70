"""Kinds of what flights cannot tell by how they moved."""

DELAYS, NOISES, LEVER_ARMS, MINUTES, THINNED = "delays", "noises", "lever_arms", "minutes", "thinned_gnss"
