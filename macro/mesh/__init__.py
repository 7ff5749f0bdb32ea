"""Meshes of blocks in dolfinx, and what their contact face consists of."""
