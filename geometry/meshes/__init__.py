"""Meshes of blocks by gmsh: flat ones, refined ones, families whose results are extrapolated."""
