"""The bodies of a scene: blocks, bodies on meshes, pairs, and their terms in contact problems."""
