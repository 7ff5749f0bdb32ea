"""Says what a run will do and why, and what is doubtful, before anything expensive starts."""

from __future__ import annotations

from collections.abc import Iterator

from geometry.materials import Material
from geometry.statistics import roughness
from micro import AsperityModel, HalfSpaceModel
from multiscale.couplings.assembly import newton_choice
from multiscale.measured_errors import unmeasured
from multiscale.planning.auto_keys import heights_per_wave
from multiscale.planning.block_plan import block_statement, block_warnings
from multiscale.planning.body_plan import body_term_statement, sample_statement
from multiscale.planning.work import Work
from multiscale.readable import number, quantity
from multiscale.scene.keys import bare_quantities
from multiscale.setup.problem import ProblemSetup

_INTERACTING = ("elliptic", "circular")


def statements(setup: ProblemSetup, work: Work | None = None) -> Iterator[tuple[str, str]]:
    """Yield pairs of topic and sentence that say what will be done and why.

    Args:
        setup: The problem.
        work: What the run computes, counted; None leaves it out.
    """
    yield "inputs", inputs_statement(setup)
    yield "surface", surface_statement(setup)
    yield "contact", _contact(setup)
    if setup.counter_surface is not None or setup.scene.counter_surface is not None:
        yield "two rough sides", _two_sides(setup)
    yield "micro model", _model(setup)
    yield "coupling", _coupling(setup)
    if setup.has_block:
        yield "block" if setup.face is None else "body", block_statement(setup)
        if setup.bodies.first is not None and not setup.samples:
            yield "body term", body_term_statement(setup)
    if setup.uses_laws:
        choice = newton_choice(setup)
        way = "condensed to the patches" if choice.condensed else "full, on the mesh"
        yield "newton", f"{way}: {choice.why}"
    yield "load", _load(setup)
    if setup.decision is not None:
        yield "choice", setup.decision.sentence
    if work is not None:
        yield from work.statements()
    yield "error", _error(setup)


def warnings(setup: ProblemSetup) -> Iterator[str]:
    """Yield what a user should know about the validity of the scene.

    Args:
        setup: The problem.
    """
    yield from setup.surface.notes
    if bare := list(bare_quantities(setup.scene.written)):
        yield f"numbers without a unit: {', '.join(bare)}"
    excess = setup.surface.highest - setup.surface.heights.max()
    known = setup.plane_at_largest_load is not None
    size = setup.largest_interference if known else roughness(setup.surface).sq
    if not setup.zero and excess > 0.1 * size:
        x, y = setup.surface.highest_point
        yield (
            "the approach counts from the interpolant's highest point, "
            f"{quantity(excess, 'mm', 3)} above the highest of the given heights, at "
            f"x = {x:.4g} mm, y = {y:.4g} mm: the heights are too coarse or too noisy there"
        )
    if known and not setup.interfering_patches:
        yield "nothing lies within the largest approach: no force will act"
    if setup.uses_summits and setup.interfering_border_maxima:
        yield (
            "maxima on the surface's border within the largest approach: "
            f"{setup.interfering_border_maxima}; an 8-neighbour search cannot confirm them, and "
            "they carry no load here"
        )
    if isinstance(setup.micro, AsperityModel) and setup.asperities.flat:
        yield (
            f"{setup.asperities.flat} summits are flat, as heights in steps are: without radii "
            "they carry no load here; take micro.model = 'half-space'"
        )
    if setup.scene.output.fields and not setup.has_block:
        yield (
            "output.fields: there is no block, and no fields are written; the analytic coupling "
            "presses a half-space (a block has coupling.kind = 'concurrent', 'consistent', "
            "'isolated' or 'reference')"
        )
    without = ("auto", "none") if setup.uses_laws else ("none",)
    cells = isinstance(setup.micro, HalfSpaceModel) and setup.scene.output.contact not in without
    if setup.scene.output.figures == "all" and not cells:
        yield (
            "output.figures = 'all': no block.png is drawn, for no pressures of cells are known; "
            "micro.model = 'half-space' has them, with laws where output.contact = 'last'"
        )
    if setup.has_block:
        yield from block_warnings(setup)
    if setup.decision is not None and setup.decision.warning:
        yield setup.decision.warning


def inputs_statement(setup: ProblemSetup) -> str:
    """Say the elastic constants and the dimensions that a run takes.

    Args:
        setup: The problem.
    """
    return f"{material_statement(setup)}; a surface of {dimension_statement(setup)}"


def material_statement(setup: ProblemSetup) -> str:
    """Say the elastic constants of both sides.

    Args:
        setup: The problem.
    """
    second = setup.materials.second
    other = "a half-space" if setup.both_give_way else "a body"
    against = f", against {other} with {_constants(second)}" if second else ""
    return f"{_constants(setup.materials.first)}{against}"


def dimension_statement(setup: ProblemSetup) -> str:
    """Say the dimensions of the surface and of what it lies on.

    Args:
        setup: The problem.
    """
    lx, ly = (quantity(side, "mm") for side in setup.surface.lengths)
    high = setup.face.depth if setup.face else setup.shape.height
    what = "block" if setup.block_shape else "body"
    solid = f"a {what} {quantity(high, 'mm')} high" if setup.has_block else "a half-space"
    return f"{lx} × {ly} on {solid}{' as sample' if setup.samples else ''}"


def _constants(material: Material) -> str:
    return f"E = {quantity(material.young_modulus, 'MPa')}, ν = {material.poisson_ratio:g}"


def surface_statement(setup: ProblemSetup) -> str:
    """Say what the surface is.

    Args:
        setup: The problem.
    """
    surface, spectrum = setup.surface, setup.scene.surface.spectrum
    rough = roughness(surface)
    lx, ly = (quantity(side, "mm") for side in surface.lengths)
    continued = ", continued periodically" if setup.scene.surface.periodic else ""
    text = (
        f"{surface.source}; {surface.grid[0]} × {surface.grid[1]} heights on "
        f"{lx} × {ly}{continued}, "
        f"rms height {quantity(rough.sq, 'mm', 3)}, rms gradient {number(rough.sdq, 3)}"
    )
    if spectrum is None:
        return text
    waves = heights_per_wave(spectrum, surface.grid, surface.lengths)
    return f"{text}, {waves:.3g} heights along the shortest wavelength"


def _contact(setup: ProblemSetup) -> str:
    if setup.uses_summits:
        within = f"{int(setup.interfering_summits.sum())} within the largest approach"
        return f"{len(setup.asperities)} summits, {within}; the others cost nothing"
    if setup.plane_at_largest_load is None:
        return f"{setup.surface.heights.size} cells"
    within = f"{int((setup.cell_interference > 0.0).sum())} within the largest approach"
    return f"{setup.surface.heights.size} cells, {within}"


def _two_sides(setup: ProblemSetup) -> str:
    """Say how the sides lie on each other, and whose slopes count."""
    section = setup.scene.counter_surface
    text = "[counter_surface], turned over, lies on [surface]"
    if section is not None and section.rotation:
        text += f", turned by {section.rotation:g}°"
    if section is not None and any(section.shift):
        text += (
            f", moved by {quantity(section.shift[0], 'mm')} and {quantity(section.shift[1], 'mm')}"
        )
    if not setup.finite_slopes or setup.samples:
        return f"{text}; the heights of both add"
    if setup.materials.second is None:
        rigid = "the slopes of [surface] alone count: the other side is rigid"
        return f"{text}; the heights of both add, {rigid}"
    return f"{text}; the heights of both add, and the slopes of each count on its own body"


def _model(setup: ProblemSetup) -> str:
    if setup.micro is None:
        return "none: contacts are meshed, and the keys of [micro] are not used"
    micro, name = setup.scene.micro, setup.model.name
    if micro.model in _INTERACTING:
        return f"{name}, solved by {micro.solver}"
    unused = micro.solver != type(micro)().solver
    return f"{name}; it has no use for micro.solver" if unused else name


def _coupling(setup: ProblemSetup) -> str:
    if setup.samples:
        return sample_statement(setup)
    coupling, patches = setup.scene.coupling, setup.patches
    grid = f"{patches.grid[0]} × {patches.grid[1]} patches"
    if setup.meshes is not None:
        method = setup.scene.reference.method
        return (
            f"reference: the rough surface itself, meshed and pressed by {method}; {grid} gather "
            "the results"
        )
    if not setup.has_block:
        counted = "; displacements, and so the approach, count from the mean of the surface"
        return "analytic: the micro model alone on a half-space, no finite elements" + (
            counted if setup.scene.surface.periodic else ""
        )
    if not setup.uses_laws:
        return (
            "concurrent: the whole surface on the block at every load step, no laws; "
            f"{grid} gather the results"
        )
    if coupling.kind == "isolated":
        made = f"every patch alone, Love's {coupling.love} displacement"
    else:
        made, tilt = "all from one solution of the whole surface", setup.scene.loading.tilt
        if tilt == "free":
            made += " under the tilt that the plane takes at each approach"
        elif any(tilt):
            made += " under the load's tilt"
    if setup.plane_at_largest_load is not None:
        laws = setup.interfering_patches
        grid += f", {laws} get a law, {patches.count - laws} stay open"
    return f"{coupling.kind}: {grid}; {made}; {coupling.interface} closure"


def _load(setup: ProblemSetup) -> str:
    load_history = setup.scene.loading
    forced = load_history.quantity == "force"
    unit, what = ("N", "a force") if forced else ("mm", "an approach")
    way = ", ".join(quantity(point, unit, 6) for point in load_history.points)
    again = f", {load_history.cycles} times" * (load_history.cycles > 1)
    text = f"{load_history.count} steps to {what} of {way}{again}"
    if setup.zero:
        depth = quantity(setup.zero, "mm", 4)
        text += f", approaches from the {setup.scene.loading.zero}, {depth} below first touch"
    if load_history.force_change is not None:
        text += f", halved where the force changes by more than {load_history.force_change:.3g}"
    if load_history.slopes is None:
        text += ", the plane free to tilt"
    elif any(load_history.slopes):
        text += f", tilted by {_slopes(load_history.slopes)}"
    if forced and setup.plane_at_largest_load is not None:
        approach = quantity(setup.plane.approach - setup.zero, "mm", 3)
        text += f"; on a half-space its approach is about {approach}"
    return text


def _slopes(tilt: tuple[float, float]) -> str:
    return f"{1e3 * tilt[0]:.3g} and {1e3 * tilt[1]:.3g} µm/mm along x and y"


def _error(setup: ProblemSetup) -> str:
    """Say how the run will know its error."""
    if why := unmeasured(setup):
        return f"not measured: {why}"
    if setup.meshes is not None:
        return "the meshes of the reference tell it, at every load step"
    which = "every load step" if setup.scene.output.check == "all" else "the last load step"
    body = ", body" if setup.has_block else "; there is no block"
    return f"measured at {which}, by cause: grid, zero, slopes{body}{' and laws' * setup.uses_laws}"
