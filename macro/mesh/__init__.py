"""Meshes of blocks, flat and rough, and of bodies in dolfinx, and what their faces consist of."""
