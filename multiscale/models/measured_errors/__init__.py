"""Errors of load steps by cause: of laws of samples, of shear, and as columns and reports say them.

Those of contacts on cells are measured by `micro.half_space.error_probe`.
"""
