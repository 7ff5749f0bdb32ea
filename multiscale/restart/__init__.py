"""Checkpoints, signals and the folder lock: how a run is stopped and goes on later."""
