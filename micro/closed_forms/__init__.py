"""Closed forms of contact mechanics: Hertz, Love and Boussinesq.

`hertz` is the contact of one paraboloid, with the shape of its ellipse from `ellipse` and the
displacements around it from `hertz_field`. `love` has the surface displacements by uniform pressure
on rectangles, `boussinesq` displacements and stresses in the depth below them.
"""
