"""Runs a scene for many values of its keys: many seeds, a range of moduli, a list of files."""
