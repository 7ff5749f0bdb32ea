"""Counts what a run computes, and says of what order of magnitude its time is.

The work of a contact problem is its cells times its products with the compliance, that of a mesh
its unknowns times its multigrid cycles. Two rates of one core make seconds of them. No clock is
read: the same scene has the same work on every machine, and a run tells its own pace after its
first load step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from micro import HalfSpaceModel
from multiscale.couplings.assembly import CYCLES_PER_PATCH, full_cycles, newton_choice
from multiscale.planning.auto_keys import SOLUTIONS_OF_LAWS
from multiscale.planning.memory_costs import Launch, checks_finer, memory_parts, step_count
from multiscale.readable import duration, number
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import mesh_unknowns

CELL_PRODUCTS = 3e7
"""Cells × products a second. Load steps on 128², 256² and 512² cells without finite slopes took 21,
66 and 260 ms (docs/speed.md, 2026-11-22), with some 30 products each."""
UNKNOWN_CYCLES = 1e6
"""Unknowns × multigrid cycles a second. Hexahedra and tetrahedra, linear and quadratic, took 0.5 to
2.6 µs per unknown and cycle (8 to 131 thousand unknowns, 2026-11-22)."""

_PRODUCTS, _SLOPES = 30.0, 2.4
"""Products of a solution, 15 to 60 on 64² to 1024² cells, and the factor of finite slopes."""
_CHECK, _FINER = 2.0, 6.0
"""Solutions on the run's cells that an error check is worth, and where it solves a finer grid."""
_CYCLES_PER_ROW = 3.0
"""Multigrid cycles of a row of consistent laws on a mesh, whose displacements it takes."""
_SET_UP = 20.0
"""Multigrid cycles that meshing, the stiffness and its multigrid are worth: 9 to 70."""
_REFERENCE_CYCLES = {1: 30.0, 2: 60.0}
"""Multigrid cycles of a load step of a reference by degree: 15 to 44, and 51 to 90."""
_FACE_CYCLES = 1000.0
"""Cycles that the compliance of a meshed body's face in 64 modes is worth."""
_START, _PICTURES = 2.0, 4.0
"""Time of imports and tables, and of figures and report [s]."""
_ORDERS = (1, 3, 10, 30, 120, 300, 900, 3600, 3 * 3600, 10 * 3600, 24 * 3600, 72 * 3600, 240 * 3600)
"""Times that are said [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What a run computes.

    Attributes:
        cells: Cells of its contact problem, which isolated laws share; of asperities the pairs that
            interact; 0 where contact is meshed.
        solutions: Contact problems that are solved, error check and rows of laws included.
        rows: Rows of laws; 0 without laws.
        products: Cells or pairs times products with the compliance, of all contact problems.
        unknowns: Degrees of freedom of all meshes; 0 without meshes.
        cycles: Unknowns times multigrid cycles, of all meshes.
        besides: Time of imports and output [s].
        ranks: Processes that share the meshes.
        parts: Memory of each part of the first process, held together at its largest [B].
        of_pairs: Whether pairs of asperities are counted instead of cells.
    """

    cells: int
    solutions: float
    rows: int
    products: float
    unknowns: int
    cycles: float
    besides: float
    ranks: int
    parts: dict[str, float]
    of_pairs: bool = False

    @property
    def computing(self) -> float:
        """Time of contact problems and meshes, to an order of magnitude [s].

        It is that of cores of the kind that the rates were measured on.
        """
        meshes = self.cycles / UNKNOWN_CYCLES / self.ranks
        return self.products / CELL_PRODUCTS + meshes

    @property
    def seconds(self) -> float:
        """Time of the whole run, to an order of magnitude [s]."""
        return self.besides + self.computing

    @property
    def memory(self) -> float:
        """Largest memory of the first process [B]."""
        return sum(self.parts.values())

    def statements(self) -> Iterator[tuple[str, str]]:
        """Yield pairs of topic and sentence that say what was counted and what it takes."""
        counted = []
        if self.cells:
            laws = f", {self.rows} of them rows of laws" if self.rows else ""
            what = "pairs" if self.of_pairs else "cells"
            counted.append(
                f"about {self.solutions:.0f} contact problems{laws}, on {self.cells} {what} each: "
                f"{_millions(self.products)} {what} × products"
            )
        if self.cycles:
            counted.append(
                f"meshes of about {_millions(self.unknowns)} unknowns: "
                f"{_millions(self.cycles)} unknowns × multigrid cycles"
            )
        if counted:
            yield "work", "; ".join(counted)
        largest = max(self.parts, key=lambda part: self.parts[part])
        yield (
            "cost",
            f"of the order of {magnitude(self.seconds)}, more on slow or busy cores; the run tells "
            f"its own pace after its first load step; {self.memory / 1e6:.0f} MB, most of it for "
            f"the {largest}",
        )


def _millions(count: float) -> str:
    return f"{number(1e-6 * count, 2)} million"


def magnitude(seconds: float) -> str:
    """Return the order of magnitude of a time, such as ``10 s`` or ``3 h``.

    Args:
        seconds: The time [s].
    """
    return duration(min(_ORDERS, key=lambda one: abs(math.log(one / max(seconds, 1e-3)))))


def work_of(setup: ProblemSetup, launch: Launch | None = None) -> Work:
    """Count what a run computes.

    Args:
        setup: The problem.
        launch: How the run is started; by default in this process.
    """
    launch, output = launch or Launch(), setup.scene.output
    steps = step_count(setup.scene.loading.load_history)
    rows = SOLUTIONS_OF_LAWS * max(sum(len(region.surfaces) for region in setup.samples), 1)
    rows = rows if setup.uses_laws else 0
    cells, solutions, products = _contact_work(setup, steps, rows)
    unknowns, cycles = _mesh_work(setup, steps, rows, launch)
    return Work(
        cells=cells,
        solutions=solutions,
        rows=rows,
        products=products,
        unknowns=unknowns,
        cycles=cycles,
        besides=_START + _PICTURES * bool(output.figures or output.report),
        ranks=launch.ranks,
        parts=memory_parts(setup, launch),
        of_pairs=not isinstance(setup.micro, HalfSpaceModel),
    )


def _contact_work(setup: ProblemSetup, steps: int, rows: int) -> tuple[int, float, float]:
    """Return cells of a contact problem, problems, and cells times products of all."""
    if setup.micro is None:
        return 0, 0.0, 0.0
    output, solutions = setup.scene.output, float(rows or steps)
    if isinstance(setup.micro, HalfSpaceModel):
        cells = int(setup.micro.surface.heights.size)
        if output.check != "none" and not setup.samples:
            each = _FINER if checks_finer(setup, cells) else _CHECK
            solutions += each * (steps if output.check == "all" else 1)
        factor = _SLOPES if setup.finite_slopes else 1.0
        return cells, solutions, solutions * cells * _PRODUCTS * factor
    pairs = int(setup.interfering_summits.sum()) ** 2  # which interact by a matrix
    return pairs, solutions, solutions * pairs * _PRODUCTS


def _mesh_work(setup: ProblemSetup, steps: int, rows: int, launch: Launch) -> tuple[int, float]:
    """Return the unknowns of all meshes, and unknowns times multigrid cycles."""
    if setup.meshes is not None:
        unknowns = sum(setup.meshes.unknowns)
        return unknowns, unknowns * (_SET_UP + steps * _REFERENCE_CYCLES[setup.meshes.degree])
    faces = [face.unknowns for face in (setup.face, setup.counter_face) if face and face.digest]
    face_cycles = _FACE_CYCLES * launch.solves_face
    if not (setup.has_block and setup.scene.on_mesh):
        return sum(faces), sum(faces) * face_cycles
    unknowns = sum(faces) or mesh_unknowns(setup.shape)
    cycles = _SET_UP + face_cycles
    if newton_choice(setup).condensed:
        cycles += CYCLES_PER_PATCH * setup.patches.count
    else:
        cycles += full_cycles(setup, steps)
        if setup.scene.kind == "consistent":
            cycles += _CYCLES_PER_ROW * rows
    return unknowns, unknowns * cycles
