"""Time and memory that a run is predicted to take."""
