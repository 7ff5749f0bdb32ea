"""What a scene leaves open, resolved to values before the run."""
