"""Errors of load steps, measured in the run by further contact problems."""
