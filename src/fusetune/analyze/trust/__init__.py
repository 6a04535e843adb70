"""How far the replay of a flight can be trusted, and how close one replay is to another."""
