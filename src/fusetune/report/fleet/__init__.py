"""A page of all flights: which have what, what changed when, which stand out, how every figure is spread."""
