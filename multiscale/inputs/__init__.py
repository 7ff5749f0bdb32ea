"""What the sections of a scene become: surfaces, samples, loads, meshes, and the memory of them."""
