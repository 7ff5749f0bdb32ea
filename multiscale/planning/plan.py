"""States what a run will do, and why, before anything expensive starts."""

from __future__ import annotations

from collections.abc import Iterator

from geometry.statistics import roughness
from micro import MODELS, AsperityModel
from multiscale.costs.prediction import Cost
from multiscale.couplings.newton_choice import newton_choice
from multiscale.planning.block_plan import block_statement, block_warnings
from multiscale.planning.forecast import cost_statement, error_statement
from multiscale.planning.reference_plan import (
    NO_MICRO_MODEL,
    reference_coupling,
    reference_statement,
    reference_warnings,
)
from multiscale.resolution.surface_grid import heights_per_wave
from multiscale.setup.problem import Stage

_INTERACTING = ("elliptic", "circular")


def statements(stage: Stage, made: Cost | None = None) -> Iterator[tuple[str, str]]:
    """Yield pairs of topic and sentence that say what will be done and why.

    Args:
        stage: The scene's ingredients.
        made: What is predicted; None leaves it out.
    """
    yield "surface", surface_statement(stage)
    yield "contact", _contact(stage)
    yield "micro model", _model(stage)
    yield "coupling", _coupling(stage)
    if stage.meshes is not None:
        yield "block", reference_statement(stage.scene, stage.meshes)
    elif stage.embedded:
        yield "block", block_statement(stage)
    if stage.by_laws:
        yield "newton", _newton(stage)
    yield "load", _load(stage)
    if stage.decision is not None:
        yield "choice", stage.decision.sentence
    if made is not None:
        yield "cost", cost_statement(made)
    yield "error", error_statement(stage)


def warnings(stage: Stage) -> Iterator[str]:
    """Yield what a user should know about the validity of the scene.

    Args:
        stage: The scene's ingredients.
    """
    yield from _surface_warnings(stage)
    if stage.scene.output.fields and not stage.embedded:
        yield "output.fields: there is no block, and no fields are written"
    if stage.by_laws:
        yield from _patch_warnings(stage)
    if stage.meshes is not None:
        yield from reference_warnings(stage.scene, stage.meshes)
    elif stage.embedded:
        yield from block_warnings(stage)
    if stage.decision is not None and stage.decision.warning:
        yield stage.decision.warning


def _surface_warnings(stage: Stage) -> Iterator[str]:
    excess = stage.surface.highest - stage.surface.heights.max()
    if excess > 0.1 * stage.deepest:
        x, y = stage.surface.highest_point
        yield (
            f"the approach counts from the interpolant's highest point, {1e3 * excess:.3g} µm "
            f"above the highest of the given heights, at x = {x:.4g} mm, y = {y:.4g} mm: the "
            "heights are too coarse or too noisy there"
        )
    if not stage.reached_patches:
        yield "nothing lies within the largest approach: no force will act"
    if stage.ignores_border and stage.reached_at_border:
        yield (
            "maxima on the surface's border within the largest approach: "
            f"{stage.reached_at_border}; an 8-neighbour search cannot confirm them, and they carry "
            "no load here"
        )
    if isinstance(stage.micro, AsperityModel) and stage.asperities.flat:
        yield (
            f"{stage.asperities.flat} summits are flat, as heights in steps are: without radii "
            "they carry no load here; take micro.curvature = 'contact', islands or half-space"
        )


def _patch_warnings(stage: Stage) -> Iterator[str]:
    isolated = stage.scene.coupling.kind == "isolated"
    grids = zip(stage.surface.grid, stage.patches.grid, strict=True)
    cut = any(cells % patches for cells, patches in grids)
    if isolated and stage.model.name == "islands" and cut:
        yield (
            "patch borders cut cells of the surface: every patch is taken alone along whole cells; "
            "a grid that is a multiple of the patches would fit"
        )
    widths = [length + 2.0 * stage.shape.margin for length in stage.surface.lengths]
    if isolated and max(stage.patches.size) > 0.5 * min(stage.shape.height, *widths):
        yield (
            "the patches are not small against the block: the half-space correction (Love) inside "
            "their laws is an approximation there"
        )


def surface_statement(stage: Stage) -> str:
    """Say what the surface is.

    Args:
        stage: The scene's ingredients.
    """
    surface, rough = stage.surface, roughness(stage.surface)
    return (
        f"{surface.source}; {surface.grid[0]} × {surface.grid[1]} heights on "
        f"{surface.lengths[0]:g} × {surface.lengths[1]:g} mm, rms height {1e3 * rough.sq:.3g} µm, "
        f"rms gradient {rough.sdq:.3g}{_along_waves(stage)}"
    )


def _along_waves(stage: Stage) -> str:
    spectrum = stage.scene.surface.spectrum
    if spectrum is None:
        return ""
    waves = heights_per_wave(spectrum, stage.surface.grid, stage.surface.lengths)
    return f", {waves:.3g} heights along the shortest wavelength"


def _contact(stage: Stage) -> str:
    if stage.by_summits:
        return (
            f"{len(stage.asperities)} summits, {int(stage.reached.sum())} within the largest "
            "approach; the others cost nothing"
        )
    reached = stage.reached_cells
    return f"{reached.size} cells, {int(reached.sum())} within the largest approach"


def _model(stage: Stage) -> str:
    if stage.micro is None:
        return NO_MICRO_MODEL
    if stage.choice is not None:
        return f"auto: {stage.choice.sentence}"
    micro = stage.scene.micro
    solver = f", solved by {micro.solver}" if micro.model in _INTERACTING else ""
    idle = ", ".join(f"micro.{key}" for key in _idle_keys(stage))
    return stage.model.name + solver + (f"; it has no use for {idle}" if idle else "")


def _idle_keys(stage: Stage) -> Iterator[str]:
    """Yield keys of ``[micro]`` that the scene states and its model does not ask for."""
    micro = stage.scene.micro
    asked = {
        "solver": micro.model in _INTERACTING,
        "curvature": micro.model in MODELS,
        "border": micro.model in MODELS,
    }
    for key, used in asked.items():
        if not used and getattr(micro, key) != type(micro).model_fields[key].default:
            yield key


def _coupling(stage: Stage) -> str:
    coupling, patches = stage.scene.coupling, stage.patches
    if stage.meshes is not None:
        return reference_coupling(stage.scene)
    if not stage.embedded:
        return "analytic: the micro model alone on a half-space, no finite elements"
    grid = f"{patches.grid[0]} × {patches.grid[1]} patches"
    if not stage.by_laws:
        return (
            "concurrent: the whole surface on the block at every load step, no laws; "
            f"{grid} gather the results"
        )
    reached = stage.reached_patches
    made = {
        "isolated": f"every patch alone, Love's {coupling.love} displacement",
        "consistent": "all from one solution of the whole surface" + _under_tilt(stage),
    }
    return (
        f"{coupling.kind}: {grid}, {reached} get a law, {patches.count - reached} stay open; "
        f"{made[coupling.kind]}; {coupling.interface} closure"
    )


def _under_tilt(stage: Stage) -> str:
    """Say under which plane the laws of the whole surface are made."""
    tilt = stage.furthest[1]
    if stage.scene.loading.tilt == "free":
        return f" under the tilt that the plane takes on a half-space, {_slopes(tilt)}"
    return " under the load's tilt" if any(tilt) else ""


def _newton(stage: Stage) -> str:
    choice = newton_choice(stage)
    return (
        f"{'condensed to the patches' if choice.condensed else 'full, on the mesh'}: {choice.why}"
    )


def _load(stage: Stage) -> str:
    programme = stage.scene.loading.programme
    scale, unit = (1.0, "N") if programme.quantity == "force" else (1e3, "µm")
    way = ", ".join(f"{scale * point:g} {unit}" for point in programme.points)
    text = f"{programme.count} steps to {_article(programme.quantity)} of {way}"
    if programme.force_change is not None:
        text += f", halved where the force changes by more than {programme.force_change:.3g}"
    if programme.tilt is None:
        text += ", the plane free to tilt"
    elif any(programme.tilt):
        text += f", tilted by {_slopes(programme.tilt)}"
    if programme.quantity == "force":
        text += f"; on a half-space its approach is {1e3 * stage.furthest[0]:.4g} µm"
    return text


def _slopes(tilt: tuple[float, float]) -> str:
    return f"{1e3 * tilt[0]:.3g} and {1e3 * tilt[1]:.3g} µm/mm along x and y"


def _article(quantity: str) -> str:
    return f"an {quantity}" if quantity == "approach" else f"a {quantity}"
