"""Missions: read, checked, made from shapes, planned and written."""
