"""States what a run will do, and why, before anything expensive starts."""

from __future__ import annotations

from collections.abc import Iterator

from geometry.meshes import alignment
from geometry.statistics import roughness
from multiscale.stage import Stage


def statements(stage: Stage) -> Iterator[tuple[str, str]]:
    """Yield pairs of topic and sentence that say what will be done and why."""
    scene = stage.scene
    yield "surface", _surface(stage)
    yield "contact", _contact(stage)
    yield "micro model", _model(stage)
    yield "coupling", _coupling(stage)
    if stage.embedded:
        yield "block", _block(stage)
    yield (
        "load",
        f"{scene.loading.steps} steps to an approach of {1e3 * scene.loading.approach:g} µm"
        + (f", tilt {scene.loading.tilt}" if any(scene.loading.tilt) else ""),
    )


def warnings(stage: Stage) -> Iterator[str]:
    """Yield what a user should know about the validity of the scene."""
    yield from _surface_warnings(stage)
    if stage.embedded:
        yield from _patch_warnings(stage)
        yield from _block_warnings(stage)


def _surface_warnings(stage: Stage) -> Iterator[str]:
    excess = stage.surface.highest - stage.surface.heights.max()
    if excess > 0.1 * stage.scene.loading.approach:
        x, y = stage.surface.highest_point
        yield (
            f"the approach counts from the interpolant's highest point, {1e3 * excess:.3g} µm "
            f"above the highest of the given heights, at x = {x:.4g} mm, y = {y:.4g} mm: the "
            "heights are too coarse or too noisy there"
        )
    if not stage.reached_patches:
        yield "nothing lies within the largest approach: no force will act"
    if stage.by_summits and stage.scene.micro.border == "ignore" and stage.reached_at_border:
        yield (
            "maxima on the surface's border within the largest approach: "
            f"{stage.reached_at_border}; an 8-neighbour search cannot confirm them, and they carry "
            "no load here"
        )


def _patch_warnings(stage: Stage) -> Iterator[str]:
    grids = zip(stage.surface.grid, stage.patches.grid, strict=True)
    if stage.model.name == "islands" and any(cells % patches for cells, patches in grids):
        yield (
            "patch borders cut cells of the surface: every patch is taken alone along whole cells; "
            "a grid that is a multiple of the patches would fit"
        )
    widths = [length + 2.0 * stage.shape.margin for length in stage.surface.lengths]
    if max(stage.patches.size) > 0.5 * min(stage.shape.height, *widths):
        yield (
            "the patches are not small against the block: the half-space correction (Love) inside "
            "their laws is an approximation there"
        )


def _block_warnings(stage: Stage) -> Iterator[str]:
    cells = min(c / n for c, n in zip(stage.shape.cells[:2], stage.patches.grid, strict=True))
    if cells * stage.shape.degree < 4:
        yield (
            f"{cells:.3g} cells along a patch: fewer than four linear (two quadratic) ones make "
            "the block stiffer by several per cent under a patch's pressure; refine block.cells"
        )
    fit = alignment(stage.shape, stage.patches)
    if not fit:
        yield fit.sentence


def _surface(stage: Stage) -> str:
    surface, rough = stage.surface, roughness(stage.surface)
    return (
        f"{surface.source}; {surface.grid[0]} × {surface.grid[1]} heights on "
        f"{surface.lengths[0]:g} × {surface.lengths[1]:g} mm, rms height {1e3 * rough.sq:.3g} µm, "
        f"rms gradient {rough.sdq:.3g}"
    )


def _contact(stage: Stage) -> str:
    if stage.by_summits:
        return (
            f"{len(stage.asperities)} summits, {int(stage.reached.sum())} within the largest "
            "approach; the others cost nothing"
        )
    reached = stage.reached_cells
    return f"{reached.size} cells, {int(reached.sum())} within the largest approach"


def _model(stage: Stage) -> str:
    if stage.choice is not None:
        return f"auto: {stage.choice.sentence}"
    micro = stage.scene.micro
    solver = f", solved by {micro.solver}" if micro.model in ("elliptic", "circular") else ""
    return stage.model.name + solver


def _coupling(stage: Stage) -> str:
    coupling, patches = stage.scene.coupling, stage.patches
    if not stage.embedded:
        return "analytic: the micro model alone on a half-space, no finite elements"
    reached = stage.reached_patches
    return (
        f"{coupling.kind}: {patches.grid[0]} × {patches.grid[1]} patches, {reached} get a law, "
        f"{patches.count - reached} stay open; Love's {coupling.love} displacement, "
        f"{coupling.interface} closure"
    )


def _block(stage: Stage) -> str:
    shape, block = stage.shape, stage.scene.block
    nx, ny, nz = shape.cells
    margin = (
        f"{shape.margin:g} mm beyond it in {shape.margin_cells} cells, " if shape.margin else ""
    )
    kind = "hexahedra" if shape.element.startswith("Q") else "hexahedra split into tetrahedra"
    return (
        f"{nx} × {ny} × {nz} {kind} ({shape.element}) under the interface, grading "
        f"{shape.grading:g}, {margin}{block.sides} sides, contact modulus "
        f"{stage.model.contact_modulus:.6g} MPa"
    )
