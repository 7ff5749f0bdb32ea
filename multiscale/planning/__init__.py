"""What a run will do, take and err by, before anything expensive starts."""
