"""Smooth bodies on a block, meshed as they are, with the block's finiteness known."""

from functools import cache

import numpy as np
from mpi4py import MPI
from scipy.special import gamma

from helpers.block_cases import rough_contact
from patchlaw.geometry import BlockShape, Control, Surface, reference_shapes
from patchlaw.macro import Material
from patchlaw.micro import FreeSides, HalfSpaceModel, HertzContact
from patchlaw.micro.boundary_elements.body_modes import BodyPoints
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_term

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
MODULUS = MATERIAL.contact_modulus
COMM = MPI.COMM_SELF
SQUARE = (1.0, 1.0)


def body(profile, points=129):
    """Return the surface of heights −profile(x, y), x and y from the middle of a square of 1 mm."""
    x = (np.arange(points) + 0.5) / points - 0.5
    return Surface(heights=-profile(x[:, None], x), lengths=(1.0, 1.0))


def ellipsoid(major, minor):
    """Return the paraboloid with these principal radii along x and y [mm]."""
    return body(lambda x, y: 0.5 * (x**2 / major + y**2 / minor))


def block_body(height=1.0, sides="free", *, known=True):
    """Return the block under a square of 1 mm, whose free sides the half-space may know of."""
    shape = BlockShape(interface=SQUARE, height=height, cells=(1, 1, 1))
    free = None
    if known and sides == "free":
        nu, decay_length = MATERIAL.poisson_ratio, 0.25 * min(1.0, height)
        free = FreeSides(lengths=SQUARE, poisson_ratio=nu, decay_length=decay_length)
    return FaceTerms((block_term(shape, MATERIAL, sides, free),))


@cache
def body_term(height=1.0, sides="free", known=True):
    """Return what the block adds to the half-space and the sides it knows of."""
    block = block_body(height, sides, known=known)
    return block.term(block.face(COMM))


def on_block(surface, *, height=1.0, sides="free", known=True, tolerance=1e-8):
    """Return the half-space model of a surface on the block; slopes count as small."""
    return HalfSpaceModel(
        surface=surface,
        contact_modulus=MODULUS,
        tolerance=tolerance,
        sides=block_body(height, sides, known=known).side_term,
        body=body_term(height, sides, known),
    )


@cache
def give():
    """Return what the block gives at the middle of its top beyond the half-space [mm/N].

    It varies by a hundredth over a contact in the middle, whose shape it does not change.
    """
    middle = np.array([0.5])
    point = BodyPoints.at(body_term(known=False), middle, middle)
    return float(point.by(point)[0, 0])


def on_the_block(force_of, approach):
    """Return the approach to a half-space where force_of(approach) presses the block alike [mm]."""
    left = approach
    for _ in range(30):  # the block gives 1 to 4 %: a contraction
        left = approach - give() * force_of(left)
    return left


def hertz(major, minor, approach):
    """Return the contact of a paraboloid on the block."""

    def contact(indentation):
        return HertzContact(
            contact_modulus=MODULUS, radius_major=major, radius_minor=minor, indentation=indentation
        )

    return contact(on_the_block(lambda depth: float(contact(depth).force), approach))


def power_law(exponent, coefficient, approach):
    """Return force [N] and contact radius [mm] of z = C rⁿ on the block.

    Source:
        Sneddon 1965, doi 10.1016/0020-7225(65)90019-4, eqs. 6.1 and 6.2 with a profile C ρⁿ.
    """
    rise = np.sqrt(np.pi) * gamma(0.5 * exponent + 1.0) / gamma(0.5 * exponent + 0.5)

    def radius(depth):
        return (depth / (coefficient * rise)) ** (1.0 / exponent)

    def force(depth):
        return 2.0 * MODULUS * radius(depth) * depth * exponent / (exponent + 1.0)

    left = on_the_block(force, approach)
    return force(left), radius(left)


def meshed(surface, approach, *, method="active-set", patches=None, **options):
    """Return the family of blocks with this surface, coarse to fine; one mesh unless asked."""
    options = {"count": 1} | options
    blocks = []
    for shape in reference_shapes(surface, approach, 1.0, **options):
        blocks.append(rough_contact(shape, surface, MATERIAL, method=method, patches=patches))
    return blocks


def pressed(surface, approach, **options):
    """Return the block of one mesh, and its contact at an approach."""
    (block,) = meshed(surface, approach, **options)
    return block, block.solve(Control(approach=approach))


def semi_axes(block, state):
    """Return (a, b) of the ellipse whose Hertz pressure has the second moments found, <x²> = a²/5.

    They weigh all of the contact, and know its size better than the nodes at its border.
    """
    share = state.nodal.force / state.force
    x, y = (
        np.average((place - np.average(place, weights=share)) ** 2, weights=share)
        for place in (block.top.x, block.top.y)
    )
    return np.sqrt(5.0 * x), np.sqrt(5.0 * y)


def peak_pressure(block, state):
    """Return the largest pressure of a node, of those that have an area of their own [MPa]."""
    area = block.top.area
    own = area > 1e-3 * area.max()
    return float((state.nodal.force[own] / area[own]).max())
