"""What several modules of tests share: oracles, meshes, scenes and ways of starting commands."""
