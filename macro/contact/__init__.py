"""Contact of a meshed block with a rigid plane: through laws of patches, or node by node."""
