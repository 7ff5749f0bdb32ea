"""Auto values of a scene: which keys have one, and how they are chosen from measured errors."""
