"""Sets tried on a flight for a search: what they did on samples and gaps that a base set alone defines."""
