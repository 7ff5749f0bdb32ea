"""Shapes of blocks and their meshes, families of them, and the files of gmsh."""
