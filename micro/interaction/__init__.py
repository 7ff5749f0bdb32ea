"""Contacts that displace each other: the contact problem, its solvers and the pairs of contacts."""
