"""Which mission a flight flew, leg by leg, and what manoeuvre each moment of it is."""
