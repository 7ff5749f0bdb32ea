"""Closed forms of contact mechanics: Hertz and Love.

`hertz` is the contact of one paraboloid, with the displacements around it from `hertz_field`.
`love` has the surface displacements by uniform pressure on rectangles.
"""
