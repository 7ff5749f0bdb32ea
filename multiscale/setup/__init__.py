"""The problem a scene describes: surface, patches, micro model, shapes of meshes, checks."""
