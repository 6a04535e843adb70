"""One cause each: its signs, its evidence, its remedy and where this is known from."""
