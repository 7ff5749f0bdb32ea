"""Algebraic multigrid on bodies whose nodes form no lattice: options of hypre's BoomerAMG.

Coarse unknowns are some of the finer ones (PMIS or HMIS), and the others are interpolated from at
most four of them ("extended+i"; De Sterck, Falgout, Nolting & Yang 2008, doi 10.1002/nla.544), each
displacement component from its own kind. Two settings of twelve were best on brake pads, flanges,
rings and L shapes of 3·10⁴ to 6·10⁵ unknowns, with moduli up to 10⁴ : 1.

Tetrahedra coarsen node by node, by the norms of the 3 × 3 blocks: 13 to 20 iterations to 1e-8, and
31 on flat cells, with half the time and three quarters of the memory of coarsening by component.
Hexahedra coarsen by component with a high threshold: 10 to 17 iterations, 43 on cells 20 times as
long as high on rollers. Norms of blocks do not tell the directions of such cells apart: 128 to 255.

Smoothed aggregation (PETSc's GAMG) takes 11 to 20 iterations on cells of even lengths, but 61 to
131 on flat ones on rollers, and its set-up takes 2 to 15 times as long, because its interpolation
has tens of entries in a row. With a threshold, flat cells coarsen so slowly that set-up takes
minutes. It is used on request (``-patchlaw_pc_type gamg``). The figures are of PETSc 3.18.
"""

from __future__ import annotations

from collections.abc import Mapping

_BOTH: Mapping[str, object] = {
    "pc_type": "hypre",
    "pc_hypre_type": "boomeramg",
    "pc_hypre_boomeramg_interp_type": "ext+i",
    "pc_hypre_boomeramg_P_max": 4,
}

_BY_NODES: Mapping[str, object] = {
    **_BOTH,
    "pc_hypre_boomeramg_nodal_coarsen": 4,
    "pc_hypre_boomeramg_coarsen_type": "PMIS",
    "pc_hypre_boomeramg_strong_threshold": 0.25,
}

_BY_COMPONENTS: Mapping[str, object] = {
    **_BOTH,
    "pc_hypre_boomeramg_coarsen_type": "HMIS",
    "pc_hypre_boomeramg_strong_threshold": 0.7,
}


def algebraic_options(*, hexahedral: bool) -> Mapping[str, object]:
    """Return PETSc's options of algebraic multigrid for linear elements.

    Args:
        hexahedral: Whether the cells are hexahedra.
    """
    return _BY_COMPONENTS if hexahedral else _BY_NODES
