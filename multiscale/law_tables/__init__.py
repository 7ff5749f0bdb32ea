"""Patch laws: made of a rough surface, refined, packed, kept on disk."""
