"""Errors of load steps by cause, measured in the run: of contacts, of laws of samples, of shear."""
