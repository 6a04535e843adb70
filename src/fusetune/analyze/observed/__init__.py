"""A flight as the vehicle logged it and as it is replayed, with what several questions ask of it."""
