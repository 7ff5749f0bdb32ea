"""Load histories, the record of a load step, and energies."""
