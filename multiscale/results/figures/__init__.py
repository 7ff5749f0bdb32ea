"""Draws what results hold, in one style; matplotlib is loaded when something is drawn."""
