"""Causes, each a file: what shows it, how sure that is, and what to do about it."""
