"""What a vehicle loads: the changes in the names of its own release, checked, in the formats of its tools."""
