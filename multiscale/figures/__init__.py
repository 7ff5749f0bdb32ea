"""Draws what results hold, in one style."""
