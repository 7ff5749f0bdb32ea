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
from multiscale.setup.problem import ProblemSetup

_INTERACTING = ("elliptic", "circular")


def statements(setup: ProblemSetup, made: Cost | None = None) -> Iterator[tuple[str, str]]:
    """Yield pairs of topic and sentence that say what will be done and why.

    Args:
        setup: The scene's ingredients.
        made: What is predicted; None leaves it out.
    """
    yield "surface", surface_statement(setup)
    yield "contact", _contact(setup)
    yield "micro model", _model(setup)
    yield "coupling", _coupling(setup)
    if setup.meshes is not None:
        yield "block", reference_statement(setup.scene, setup.meshes)
    elif setup.has_block:
        yield "block", block_statement(setup)
    if setup.uses_laws:
        yield "newton", _newton(setup)
    yield "load", _load(setup)
    if setup.decision is not None:
        yield "choice", setup.decision.sentence
    if made is not None:
        yield "cost", cost_statement(made)
    yield "error", error_statement(setup)


def warnings(setup: ProblemSetup) -> Iterator[str]:
    """Yield what a user should know about the validity of the scene.

    Args:
        setup: The scene's ingredients.
    """
    yield from _surface_warnings(setup)
    if setup.scene.output.fields and not setup.has_block:
        yield "output.fields: there is no block, and no fields are written"
    if setup.uses_laws:
        yield from _patch_warnings(setup)
    if setup.meshes is not None:
        yield from reference_warnings(setup.scene, setup.meshes)
    elif setup.has_block:
        yield from block_warnings(setup)
    if setup.decision is not None and setup.decision.warning:
        yield setup.decision.warning


def _surface_warnings(setup: ProblemSetup) -> Iterator[str]:
    excess = setup.surface.highest - setup.surface.heights.max()
    if excess > 0.1 * setup.largest_interference:
        x, y = setup.surface.highest_point
        yield (
            f"the approach counts from the interpolant's highest point, {1e3 * excess:.3g} µm "
            f"above the highest of the given heights, at x = {x:.4g} mm, y = {y:.4g} mm: the "
            "heights are too coarse or too noisy there"
        )
    if not setup.interfering_patches:
        yield "nothing lies within the largest approach: no force will act"
    if setup.ignores_border and setup.interfering_border_maxima:
        yield (
            "maxima on the surface's border within the largest approach: "
            f"{setup.interfering_border_maxima}; an 8-neighbour search cannot confirm them, and they carry "
            "no load here"
        )
    if isinstance(setup.micro, AsperityModel) and setup.asperities.flat:
        yield (
            f"{setup.asperities.flat} summits are flat, as heights in steps are: without radii "
            "they carry no load here; take micro.curvature = 'contact', islands or half-space"
        )


def _patch_warnings(setup: ProblemSetup) -> Iterator[str]:
    isolated = setup.scene.coupling.kind == "isolated"
    grids = zip(setup.surface.grid, setup.patches.grid, strict=True)
    cut = any(cells % patches for cells, patches in grids)
    if isolated and setup.model.name == "islands" and cut:
        yield (
            "patch borders cut cells of the surface: every patch is taken alone along whole cells; "
            "a grid that is a multiple of the patches would fit"
        )
    widths = [length + 2.0 * setup.shape.margin for length in setup.surface.lengths]
    if isolated and max(setup.patches.size) > 0.5 * min(setup.shape.height, *widths):
        yield (
            "the patches are not small against the block: the half-space correction (Love) inside "
            "their laws is an approximation there"
        )


def surface_statement(setup: ProblemSetup) -> str:
    """Say what the surface is.

    Args:
        setup: The scene's ingredients.
    """
    surface, rough = setup.surface, roughness(setup.surface)
    return (
        f"{surface.source}; {surface.grid[0]} × {surface.grid[1]} heights on "
        f"{surface.lengths[0]:g} × {surface.lengths[1]:g} mm, rms height {1e3 * rough.sq:.3g} µm, "
        f"rms gradient {rough.sdq:.3g}{_along_waves(setup)}"
    )


def _along_waves(setup: ProblemSetup) -> str:
    spectrum = setup.scene.surface.spectrum
    if spectrum is None:
        return ""
    waves = heights_per_wave(spectrum, setup.surface.grid, setup.surface.lengths)
    return f", {waves:.3g} heights along the shortest wavelength"


def _contact(setup: ProblemSetup) -> str:
    if setup.uses_summits:
        return (
            f"{len(setup.asperities)} summits, {int(setup.interfering_summits.sum())} within the largest "
            "approach; the others cost nothing"
        )
    reached = setup.interfering_cells
    return f"{reached.size} cells, {int(reached.sum())} within the largest approach"


def _model(setup: ProblemSetup) -> str:
    if setup.micro is None:
        return NO_MICRO_MODEL
    if setup.choice is not None:
        return f"auto: {setup.choice.sentence}"
    micro = setup.scene.micro
    solver = f", solved by {micro.solver}" if micro.model in _INTERACTING else ""
    idle = ", ".join(f"micro.{key}" for key in _idle_keys(setup))
    return setup.model.name + solver + (f"; it has no use for {idle}" if idle else "")


def _idle_keys(setup: ProblemSetup) -> Iterator[str]:
    """Yield keys of ``[micro]`` that the scene states and its model does not ask for."""
    micro = setup.scene.micro
    asked = {
        "solver": micro.model in _INTERACTING,
        "curvature": micro.model in MODELS,
        "border": micro.model in MODELS,
    }
    for key, used in asked.items():
        if not used and getattr(micro, key) != type(micro).model_fields[key].default:
            yield key


def _coupling(setup: ProblemSetup) -> str:
    coupling, patches = setup.scene.coupling, setup.patches
    if setup.meshes is not None:
        return reference_coupling(setup.scene)
    if not setup.has_block:
        return "analytic: the micro model alone on a half-space, no finite elements"
    grid = f"{patches.grid[0]} × {patches.grid[1]} patches"
    if not setup.uses_laws:
        return (
            "concurrent: the whole surface on the block at every load step, no laws; "
            f"{grid} gather the results"
        )
    reached = setup.interfering_patches
    made = {
        "isolated": f"every patch alone, Love's {coupling.love} displacement",
        "consistent": "all from one solution of the whole surface" + _under_tilt(setup),
    }
    return (
        f"{coupling.kind}: {grid}, {reached} get a law, {patches.count - reached} stay open; "
        f"{made[coupling.kind]}; {coupling.interface} closure"
    )


def _under_tilt(setup: ProblemSetup) -> str:
    """Say under which plane the laws of the whole surface are made."""
    tilt = setup.plane_at_largest_load[1]
    if setup.scene.loading.tilt == "free":
        return f" under the tilt that the plane takes on a half-space, {_slopes(tilt)}"
    return " under the load's tilt" if any(tilt) else ""


def _newton(setup: ProblemSetup) -> str:
    choice = newton_choice(setup)
    return (
        f"{'condensed to the patches' if choice.condensed else 'full, on the mesh'}: {choice.why}"
    )


def _load(setup: ProblemSetup) -> str:
    load_history = setup.scene.loading.load_history
    scale, unit = (1.0, "N") if load_history.quantity == "force" else (1e3, "µm")
    way = ", ".join(f"{scale * point:g} {unit}" for point in load_history.points)
    text = f"{load_history.count} steps to {_article(load_history.quantity)} of {way}"
    if load_history.force_change is not None:
        text += f", halved where the force changes by more than {load_history.force_change:.3g}"
    if load_history.tilt is None:
        text += ", the plane free to tilt"
    elif any(load_history.tilt):
        text += f", tilted by {_slopes(load_history.tilt)}"
    if load_history.quantity == "force":
        text += f"; on a half-space its approach is {1e3 * setup.plane_at_largest_load[0]:.4g} µm"
    return text


def _slopes(tilt: tuple[float, float]) -> str:
    return f"{1e3 * tilt[0]:.3g} and {1e3 * tilt[1]:.3g} µm/mm along x and y"


def _article(quantity: str) -> str:
    return f"an {quantity}" if quantity == "approach" else f"a {quantity}"
