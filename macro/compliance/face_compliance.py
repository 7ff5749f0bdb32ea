"""Compliance of a block's top, and the stresses in it, in Legendre modes.

The block is solved for even and odd modes of pressure separately, which its two vertical planes of
symmetry decouple. Under a pressure that is even along an axis, the displacement component along
that axis is odd along it, and the other components are even; under an odd pressure it is the other
way round. Tractions along the top load the block with the same parities: one solution of each
serves all three directions.

Theory: sections 6 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from patchlaw.geometry import BlockShape, Material, PatchGrid
from patchlaw.geometry.meshes.block import require_inside
from patchlaw.macro.compliance.elements import Line, ProductStiffness, block_lines, nodal, upwards
from patchlaw.macro.disk_caches import cached
from patchlaw.support import Array, Indices, InputError, shared

if TYPE_CHECKING:
    from patchlaw.macro.bodies import Sides


Parity = tuple[int, int]
"""Parity of a pressure along x and along y: 0 even, 1 odd."""

PARITIES: tuple[Parity, ...] = ((0, 0), (0, 1), (1, 0), (1, 1))
"""All parities of a pressure; any pressure is the sum of four that have them."""


class Response(NamedTuple):
    """Response of the top to modes of pressure: integrals over the top of modes times fields.

    Fields are those of a mode of pressure of mean square 1 MPa². The shape is (k, l, m, n): k and l
    count the modes of the field's parity, m and n those of the pressure's. The parity of the shear
    strain is the opposite one along both axes.

    Attributes:
        normal: Displacements downwards [mm³/MPa].
        xx: Strains along x [mm²/MPa].
        yy: Strains along y [mm²/MPa].
        xy: Shear strains ε_xy, half the change of the angle [mm²/MPa].
        growth: Derivative of ``normal`` with respect to the height of the block [mm²/MPa].

    What is not asked for is NaN, of shape (1, 1, 1, 1).
    """

    normal: Array
    xx: Array
    yy: Array
    xy: Array
    growth: Array


@dataclass(frozen=True, eq=False)
class ParityBlock:
    """A block under pressures of one parity, clamped at the bottom.

    Args:
        lines: Shape functions along x, y and z.
        height: Height of the block [mm].
        material: Elastic constants.
        sides: Support of the block's sides.
        parity: Parity of the pressures.
    """

    lines: tuple[Line, Line, Line]
    height: float
    material: Material
    sides: Sides
    parity: Parity

    def response(self) -> Response:
        """Return the displacements and strains of the top by the modes of the parity."""
        (ux, uy, _), (vx, vy, _), (wx, wy, _) = self._stiffness.lines
        odd_x, odd_y = self.parity
        tops, solved = self._stiffness.solve({2: -self._modes(2)})
        sizes = len(wx.modes[odd_x::2]), len(wy.modes[odd_y::2])

        def seen(top: Array, along_x: Array, along_y: Array, *, shear: bool = False) -> Array:
            x, y = along_x[(odd_x + shear) % 2 :: 2], along_y[(odd_y + shear) % 2 :: 2]
            return np.einsum("ka,lb,abm->klm", x, y, top, optimize=True).reshape(
                len(x), len(y), *sizes
            )

        u, v, w = tops
        along_y = seen(u, ux.modes, uy.mode_slopes, shear=True)
        along_x = seen(v, vx.mode_slopes, vy.modes, shear=True)
        # derivative of the inverse stiffness when all elements grow in proportion
        growth = -self._stiffness.growth(solved) / self.height
        return Response(
            normal=-seen(w, wx.modes, wy.modes),
            xx=seen(u, ux.mode_slopes, uy.modes),
            yy=seen(v, vx.modes, vy.mode_slopes),
            xy=0.5 * (along_y + along_x),
            growth=growth.reshape(*sizes, *sizes),
        )

    def normal_response(self) -> Response:
        """Return the displacements downwards alone of the top by the modes of the parity."""
        normal = self._stiffness.works(self._modes(2)).reshape(2 * self._counts(2))
        return Response(normal, *(np.full(4 * (1,), np.nan) for _ in Response._fields[1:]))

    def traction_response(self) -> list[list[Array]]:
        """Return the displacements of the top by modes of traction along x and y.

        Modes are those that load the block with the parity of its pressures: a traction along an
        axis has the opposite parity along it.

        Returns:
            By component of the displacement, the third downwards, and of the traction the integrals
            over the top of modes times displacements, shape (k, l, m, n) each as in `Response`
            [mm³/MPa].
        """
        loads = [(-1.0 if axis == 2 else 1.0) * self._modes(axis) for axis in range(3)]
        tops, _ = self._stiffness.solve(dict(enumerate(loads[:2])))
        shapes = [self._counts(axis) for axis in range(3)]
        return [
            [
                np.tensordot(load, part).reshape(*shapes[seen], *shapes[by])
                for by, part in enumerate(np.split(top, [len(loads[0])], axis=2))
            ]
            for seen, (load, top) in enumerate(zip(loads, tops, strict=True))
        ]

    def between_modes(self, loaded: Indices) -> Array:
        """Return what the parts of this parity in modes without parity displace.

        Args:
            loaded: Indices of the modes of pressure among products of modes along x and y, (m,).

        Returns:
            Integrals of all products of modes times displacements downwards, shape (modes, m).
        """
        x, y, _ = self._stiffness.lines[2]
        modes = _products(x.modes, y.modes)
        # of a mode and its mirror image the parts of one parity are alike, up to their sign
        (x_of, x_sign), (y_of, y_sign) = _alike(x.modes), _alike(y.modes)
        alike = np.add.outer(x_of * len(y_of), y_of).ravel()[loaded]
        different, which = np.unique(alike, return_inverse=True)
        (_, _, along_z), _ = self._stiffness.solve({2: modes[different]})
        signs = np.multiply.outer(x_sign, y_sign).ravel()[loaded]
        return np.asarray(np.tensordot(modes, along_z)[:, which] * signs)

    def parity_of(self, axis: int) -> Parity:
        """Return the parity of displacements and tractions along an axis: 0 x, 1 y, 2 z."""
        (odd_x, odd_y) = self.parity
        return (odd_x + (axis == 0)) % 2, (odd_y + (axis == 1)) % 2

    def _modes(self, axis: int) -> Array:
        """Return the forces of modes of traction on functions of a component, (modes, nx, ny)."""
        (x, y, _), (odd_x, odd_y) = self._stiffness.lines[axis], self.parity_of(axis)
        return _products(x.modes[odd_x::2], y.modes[odd_y::2])

    def _counts(self, axis: int) -> tuple[int, int]:
        """Return how many modes along x and y a traction has."""
        (x, y, _), (odd_x, odd_y) = self._stiffness.lines[axis], self.parity_of(axis)
        return len(x.modes[odd_x::2]), len(y.modes[odd_y::2])

    @cached_property
    def _stiffness(self) -> ProductStiffness:
        """The stiffness, on functions of the parity of each component."""
        x, y, z = self.lines
        lines = [
            [x.of_parity(odd_x), y.of_parity(odd_y), z]
            for odd_x, odd_y in map(self.parity_of, range(3))
        ]
        if self.sides == "roller":
            for axis in (0, 1):
                lines[axis][axis] = lines[axis][axis].held()
        return ProductStiffness(lines, self.material)


def _alike(modes: Array) -> tuple[Indices, Array]:
    """Return for every mode the first one that is equal up to its sign, and the sign, (n,) both."""
    slack = 1e-12 * np.abs(modes).max(initial=0.0)
    first, sign = np.arange(len(modes)), np.ones(len(modes))
    for n, mode in enumerate(modes):
        for way in (-1.0, 1.0):
            alike = np.all(np.abs(modes[:n] - way * mode) <= slack, axis=1)
            if alike.any():
                first[n], sign[n] = np.argmax(alike), way
    return first, sign


def _products(along_x: Array, along_y: Array) -> Array:
    """Return the products of functions (k, a) along x and (l, b) along y, shape (k l, a, b)."""
    products = along_x[:, None, :, None] * along_y[None, :, None, :]
    return np.asarray(products.reshape(-1, *products.shape[2:]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaceCompliance:
    """Displacements and stresses of a block's top by pressures on it, in Legendre modes φ.

    Mode k K + l is P̂_k(x) P̂_l(y) (`geometry.face_frame`). A pressure p with the moments
    b_n = ∫ p φ_n dA displaces the top by Σ φ_m C_mn b_n.

    Args:
        normal: C, downwards, symmetric, shape (K², K²) [mm/N].
        growth: Derivative of C with respect to the block's height, symmetric, (K², K²) [1/N].
        stresses: The same for the stresses σ_xx, σ_yy and σ_xy in the face, shape (3, K², K²)
            [1/mm²]; these two are NaN where C alone was asked for.
        rough: C off by the error of the elements; NaN where that is not known, None where there is
            none.
    """

    normal: Array
    growth: Array
    stresses: Array
    rough: Array | None = None

    @classmethod
    def of(cls, normal: Array, growth: Array, stresses: Array) -> FaceCompliance:
        """Return the compliance from matrices that are symmetric up to rounding."""
        normal, growth = (0.5 * (matrix + matrix.T) for matrix in (normal, growth))
        return cls(normal=normal, growth=growth, stresses=stresses)

    @property
    def count(self) -> int:
        """Modes K along a side."""
        return int(np.sqrt(len(self.normal)) + 0.5)

    @property
    def arrays(self) -> dict[str, Array]:
        """Its arrays by name, as the cache keeps them."""
        return {name: part for name, part in asdict(self).items() if part is not None}


def face_compliance(
    lengths: tuple[float, float],
    height: float,
    material: Material,
    sides: Sides,
    count: int,
    comm: Any,
    *,
    normal_alone: bool = False,
    use_cache: bool = False,
) -> FaceCompliance:
    """Solve for the response of a block's top to every mode of pressure.

    The modes are smooth, and so are the displacements except at the edges of the clamped bottom, so
    that few elements of high order suffice. Modes of different parity are not coupled. Each parity
    is solved for by itself, and the ranks share the parities.

    Args:
        lengths: Sides (Lx, Ly) of the block's top, all of which the modes cover [mm].
        height: Height of the block [mm].
        material: Elastic constants.
        sides: Support of the block's sides.
        count: Modes K along a side of the top.
        comm: MPI communicator; None for this process alone.
        normal_alone: Whether C alone is wanted, which takes half the time.
        use_cache: Whether to read the result from the cache on disk, or to write it there.

    Returns:
        The compliance, the same on every rank and for every number of ranks.

    Raises:
        InputError: When a length is not positive, or there is no mode.

    Note:
        Collective. A free cube with 8 × 8 modes takes 0.14 s on one core. Its mean compliance is
        too small by 8e-6, 6e-5 and 4e-4 at ν = 0.15, 0.3 and 0.45.
    """
    if use_cache:
        block = (lengths, height, material, sides, count)
        solve = partial(face_compliance, *block, comm, normal_alone=normal_alone)
        key = (*block, normal_alone)
        return FaceCompliance(**cached("face", key, lambda: solve().arrays, comm))
    if not all(math.isfinite(length) and length > 0.0 for length in (*lengths, height)):
        raise InputError(
            "the block has no such size", value=(*lengths, height), allowed="lengths > 0 mm"
        )
    if count < 1:
        raise InputError("a top has one mode at least", value=count, allowed="K ≥ 1")
    lines = block_lines(lengths, height, count)
    families = [parity for parity in PARITIES if max(parity) < count]
    alike = lengths[0] == lengths[1]
    if alike and count > 1:
        families.remove((1, 0))

    of = partial(ParityBlock, lines, height, material, sides)
    response = ParityBlock.normal_response if normal_alone else ParityBlock.response
    parts = shared(comm, len(families), lambda index: response(of(families[index])))
    responses = dict(zip(families, parts, strict=True))
    if alike and count > 1:  # exchange x and y
        exchanged = Response(*(part.transpose(1, 0, 3, 2) for part in responses[0, 1]))
        responses[1, 0] = exchanged._replace(xx=exchanged.yy, yy=exchanged.xx)
    return _gathered(responses, lengths, count, material)


def _gathered(
    responses: dict[Parity, Response], lengths: tuple[float, float], count: int, material: Material
) -> FaceCompliance:
    """Join the modes of all parities, per unit of force."""
    area = lengths[0] * lengths[1]
    total = np.zeros((len(Response._fields), *4 * (count,)))
    for (odd_x, odd_y), response in responses.items():
        for field, part in zip(total, response, strict=True):
            turn = part is response.xy
            seen_x, seen_y = (odd_x + turn) % 2, (odd_y + turn) % 2
            field[seen_x::2, seen_y::2, odd_x::2, odd_y::2] = part
    normal, xx, yy, xy, growth = total.reshape(-1, count**2, count**2) / area**2
    return FaceCompliance.of(normal, growth, stresses_in_face(material, (xx, yy, xy), area))


def stresses_in_face(material: Material, strains: Sequence[Array], area: float | None) -> Array:
    """Return the stresses σ_xx, σ_yy and σ_xy in a face by Hooke's law, shape (3, K², K²) [1/mm²].

    Args:
        material: Elastic constants.
        strains: ε_xx, ε_yy and ε_xy in modes, shape (3, K², K²) [1/N].
        area: Area that the modes are on, where σ_zz = −p; None where σ_zz = 0 [mm²].
    """
    (xx, yy, xy), nu, modulus = strains, material.poisson_ratio, material.young_modulus
    plane = modulus / (1.0 - nu**2)
    stresses = np.stack([plane * (xx + nu * yy), plane * (yy + nu * xx), modulus / (1.0 + nu) * xy])
    if area is not None:
        stresses[:2] -= nu / (1.0 - nu) * (np.eye(len(xx)) / area)
    return stresses


def face_tractions(
    lengths: tuple[float, float],
    height: float,
    material: Material,
    sides: Sides,
    count: int,
    comm: Any,
) -> Array:
    """Solve for the displacements of a block's top by every mode of traction, or read them.

    Args:
        lengths: Sides (Lx, Ly) of the block's top, all of which the modes cover [mm].
        height: Height of the block [mm].
        material: Elastic constants.
        sides: Support of the block's sides.
        count: Modes K along a side of the top, at least 2.
        comm: MPI communicator; None for this process alone.

    Returns:
        Displacements along x, along y and downwards by tractions likewise, in modes: symmetric,
        shape (3, 3, K², K²) [mm/N]; the same on every rank and for every number of ranks. Those
        downwards by pressures are left 0: `face_compliance` has them.

    Note:
        Collective. The ranks share the parities.
    """

    def compute() -> dict[str, Array]:
        lines = block_lines(lengths, height, count)
        block = partial(ParityBlock, lines, height, material, sides)
        alike = lengths[0] == lengths[1]
        families = [parity for parity in PARITIES if not (alike and parity == (1, 0))]
        solve = lambda index: block(families[index]).traction_response()  # noqa: E731
        parts = shared(comm, len(families), solve)
        responses = dict(zip(families, parts, strict=True))
        if alike:  # exchange x and y
            turned, other = (1, 0, 2), responses[0, 1]
            responses[1, 0] = [
                [other[turned[seen]][turned[by]].transpose(1, 0, 3, 2) for by in range(2)]
                for seen in range(3)
            ]
        total = np.zeros((3, 3, *4 * (count,)))
        for parity, response in responses.items():
            odd = [block(parity).parity_of(axis) for axis in range(3)]
            for seen, row in enumerate(response):
                for by, part in enumerate(row):
                    (a, b), (c, d) = odd[seen], odd[by]
                    total[seen, by, a::2, b::2, c::2, d::2] = part
        total = total.reshape(3, 3, count**2, count**2) / (lengths[0] * lengths[1]) ** 2
        return {"tractions": reciprocal(total)}

    block_key = (lengths, height, material, sides, count)
    return cached("tractions", block_key, compute, comm)["tractions"]


def reciprocal(total: Array) -> Array:
    """Return displacements by tractions, symmetric, with those along the face by pressures.

    Pressures displace a face along itself as tractions along it displace it downwards (Maxwell and
    Betti), so that solutions under pressures are not needed.

    Args:
        total: By tractions along x and y, symmetric up to errors, shape (3, 3, K², K²).
    """
    found = np.zeros_like(total)
    along, found[2, :2] = total[:2, :2], total[2, :2]
    found[:2, :2] = 0.5 * (along + along.transpose(1, 0, 3, 2))
    found[:2, 2] = total[2, :2].transpose(0, 2, 1)
    return found


_TOGETHER = 16
"""Loads that a rank solves for together, whatever the number of ranks."""


def lattice_compliance(
    shape: BlockShape,
    material: Material,
    sides: Sides,
    patches: PatchGrid,
    loaded: Indices,
    comm: Any,
) -> Array:
    """Return the mean displacements of patches on a block of hexahedra by unit pressures on some.

    They are those of the elements in the block's mesh, as all their functions are products of
    functions along the axes; no mesh is made.

    Args:
        shape: The block, of hexahedra.
        material: Elastic constants.
        sides: Support of the block's sides.
        patches: N patches inside its interface.
        loaded: Indices of those that are loaded, shape (m,).
        comm: MPI communicator; None for this process alone.

    Returns:
        Displacements downwards, shape (N, m) [mm/MPa]; the same on every rank and for every number
        of ranks.

    Raises:
        InputError: When a patch reaches beyond the interface.
        NotConverged: When a solution fails.

    Note:
        Collective; the ranks share parities and loads. A load on the paper's cube of 40 × 40 × 25
        hexahedra takes 0.1 s on one core, a tenth of a solution by multigrid.
    """
    require_inside(shape.interface, patches)
    x, y, z = shape.ticks
    lines = (
        nodal(x, shape.degree, patches.borders_x),
        nodal(y, shape.degree, patches.borders_y),
        upwards(z, (shape.degree,) * (len(z) - 1)),
    )
    blocks = [ParityBlock(lines, shape.height, material, sides, parity) for parity in PARITIES]
    parts = [loaded[first : first + _TOGETHER] for first in range(0, len(loaded), _TOGETHER)]

    def response(index: int) -> Array:
        part, parity = divmod(index, len(blocks))
        return blocks[parity].between_modes(parts[part])

    found = shared(comm, len(blocks) * len(parts), response)
    sums = [sum(found[first : first + len(blocks)]) for first in range(0, len(found), len(blocks))]
    total = np.concatenate([np.zeros((patches.count, 0)), *sums], axis=1)
    return np.asarray(total / patches.areas[:, None])
