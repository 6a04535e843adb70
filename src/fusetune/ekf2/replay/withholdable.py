"""What can be withheld from the filter."""

WITHHOLDABLE = {"gnss": ("gnss_pos", "gnss_vel", "gnss_hgt"), "baro": ("baro_hgt",), "mag": ("mag",)}
"""Sensor → the aid sources whose innovations go on while it is withheld."""
