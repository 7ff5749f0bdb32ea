"""What sees every load step of a run, and adds to it: none of it is known to the physics."""
