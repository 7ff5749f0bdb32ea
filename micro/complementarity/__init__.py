"""Complementarity problems of contacts that displace each other, and Newton's methods for them."""
