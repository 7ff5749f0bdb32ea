"""Displacements that asperities cause each other, pair by pair or many at once."""
