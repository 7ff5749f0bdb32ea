"""Closed forms of contact mechanics: Hertz, Love, Boussinesq and what follows from them."""
