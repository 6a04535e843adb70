"""The checks of which a verdict is made, by what they look at."""
