"""What the sections of a scene become: surfaces, samples, loads, meshes; their work and memory."""
