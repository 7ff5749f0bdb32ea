"""Checks whether this machine is fit for runs, and prepares it for them."""
