"""Shapes of blocks and their meshes by gmsh, families of them, and the files of gmsh."""
