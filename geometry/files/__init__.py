"""Surfaces from files: numpy arrays, text matrices, point lists, instruments' formats."""
