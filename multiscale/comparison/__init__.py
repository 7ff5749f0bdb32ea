"""Compares all sensible ways to compute a scene: error against wall time."""
