"""The log that PX4's own replay leaves, read back: with which parameters it ran, and whether it bears us out."""
