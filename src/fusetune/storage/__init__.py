"""Files that are whole or not there, and that show when a byte of them has changed."""
