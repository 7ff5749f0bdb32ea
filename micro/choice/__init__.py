"""Choice of a micro model by its expected error and cost."""
