"""Position that is held where nothing measures it."""
