"""How many parameter sets the views of a flight show; rules of the workflow ask, too, so nothing is imported here."""

MOST_SHOWN_SETS = 24
"""Beside the present one: of more, the recommended one and those that predict the flight best."""
