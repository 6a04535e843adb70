"""Noise of the sensors themselves: Allan deviation, spectra, distributions, and the parameters that follow."""
