"""What the sets that were tried tell of the parameters: which matter, which are flat, and which trade off."""
