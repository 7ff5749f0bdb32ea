"""Closed forms of contact mechanics: Hertz, Mindlin and Love.

`hertz` is the contact of one paraboloid, with the displacements around it, and
the peak on a smooth crowned face, and that of a sphere that is sheared (Mindlin).
`love` has the surface displacements by uniform pressure on rectangles.
"""
