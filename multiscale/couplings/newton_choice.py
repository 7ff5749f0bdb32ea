"""Chooses between a dense Newton of the patches and the full Newton of the mesh, by cost."""

from __future__ import annotations

from dataclasses import dataclass

from multiscale.laws.law_table import LawTable
from multiscale.setup.problem import ProblemSetup

MOST_CYCLES_PER_STEP = 12
"""Multigrid cycles that a load step of the full Newton takes at most, when it starts from earlier
steps. With fewer patches that can touch it takes about one for each (the paper's cube with 4 × 4
patches, 4 of them loaded: 39 in 8 steps; with 2 of 64 that can touch: 36 in 40)."""

CYCLES_PER_PATCH = 11
"""Multigrid cycles that the compliance of one patch takes, measured on the paper's cube with 4 × 4
and 8 × 8 patches."""


_UNLESS_FLAT = "; should a patch turn out to be flat, condensed all the same"


@dataclass(frozen=True, slots=True, kw_only=True)
class NewtonChoice:
    """Which Newton solves the load steps, and why.

    Attributes:
        condensed: Whether it is the dense one of the patches.
        why: The reason, as a sentence.
    """

    condensed: bool
    why: str


def full_cycles(setup: ProblemSetup, steps: int) -> int:
    """Return the multigrid cycles that load steps on the mesh are predicted to take.

    Args:
        setup: The problem set up from the scene.
        steps: Load steps.
    """
    return steps * min(max(setup.interfering_patches, 1), MOST_CYCLES_PER_STEP)


def newton_choice(setup: ProblemSetup, table: LawTable | None = None) -> NewtonChoice:
    """Choose the Newton of the scene, or the one that is predicted to take fewer multigrid cycles.

    The full Newton spends cycles on load steps until its basis of earlier solutions spans all
    states of the patches. The condensed one spends them on the compliance, before the first step.

    Args:
        setup: The problem set up from the scene, of a coupling with laws.
        table: The laws, once made; flat patches rule out the full Newton.
    """
    coupling = setup.scene.coupling
    if coupling.decomposed:
        return NewtonChoice(condensed=True, why="the decomposed block is its compliance")
    flat = 0 if table is None else sum(law.is_flat for law in table.laws)
    if flat and coupling.newton == "auto" and coupling.interface == "patchwise":
        why = (
            f"{flat} of {setup.patches.count} patches are flat, and their pressure is a function "
            "of closure nowhere"
        )
        return NewtonChoice(condensed=True, why=why)
    if coupling.interface == "pointwise":
        return NewtonChoice(condensed=False, why="laws at points need the whole mesh")
    if coupling.newton != "auto":
        return NewtonChoice(condensed=coupling.newton == "condensed", why="as the scene asks")
    patches, steps = setup.patches.count, setup.scene.loading.load_history.count
    compliance = CYCLES_PER_PATCH * patches
    full = full_cycles(setup, steps)
    fewer = "fewer" if compliance < full else "more"
    unless = "" if compliance < full or table or setup.uses_summits else _UNLESS_FLAT
    return NewtonChoice(
        condensed=compliance < full,
        why=(
            f"the compliance of {patches} patches takes about {compliance} multigrid cycles, "
            f"{fewer} than {steps} load steps on the mesh with about {full}{unless}"
        ),
    )
