"""Observers: each reads quantities off the load steps of a run, where its scene asks for them."""
