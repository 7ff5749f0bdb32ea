"""Asperities at the summits of a surface: their contacts, fits and states."""
