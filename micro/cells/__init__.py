"""Contact on the half-space cell by cell: kernels, transforms, pressures."""
