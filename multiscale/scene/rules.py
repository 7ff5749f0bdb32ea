"""What sections of a scene do not go together; the first reason refuses it.

What a section says of itself alone is checked where it is declared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from functools import partial
from itertools import chain
from math import hypot

from patchlaw.multiscale.scene.sections import SceneSections
from patchlaw.support import InputError

Refusal = tuple[str, str, str]
"""A key, why its value makes no sense beside those of other sections, and what is allowed."""

_CELLS, _CONCURRENT = "micro.model = 'half-space'", "coupling.kind = 'concurrent'"
TURNS_BACK = (
    "does not go with a load that turns back where patch laws stand for the contact: "
    "they are those of rising loads and have no plastic depth",
    _CONCURRENT,
)
"""Why a hardness under laws is refused with a load that falls, and what is allowed."""
_SAMPLES, _OUT = "law.kind = 'representative'", "leave it out"
_RIGID = "which meshes a body under a rigid, smooth plane"
_WITHOUT = {
    "counter_body": ({"reference"}, _RIGID),
    "counter_surface": ({"reference"}, _RIGID),
    "conductance": (
        {"reference"},
        "whose meshes do not tell the stiffness of the interface from that of the block",
    ),
    "micro.hardness": ({"reference", "isolated"}, "which is elastic"),
    "leak": ({"isolated", "reference"}, "which knows no gaps of cells"),
}
"""Keys that couplings have no use for, and why."""


def check_together(scene: SceneSections, of_coupling: Iterable[str]) -> None:
    """Refuse sections that make no sense together.

    Args:
        scene: The sections, each of which makes sense.
        of_coupling: The keys that were written of the section on the coupling.

    Raises:
        InputError: With the first reason.
    """
    rules: dict[Callable[[SceneSections], Iterator[Refusal]], bool] = {
        _bodies: True,
        _body_loads: True,
        _surfaces: True,
        _couplings: True,
        partial(_samples, of_coupling=of_coupling): scene.law.representative,
        _cells: scene.micro.cells is not None,
        _hardness: bool(scene.hardness_key),
        _lacking: True,
        _leak: scene.leak is not None,
        _conductance: scene.conductance is not None,
        _friction: scene.friction is not None,
        _wear: scene.wear is not None,
        _vibration: scene.vibration is not None,
    }
    for key, problem, allowed in chain(*(rule(scene) for rule, acts in rules.items() if acts)):
        raise InputError(problem, key=key, allowed=allowed or None)


def _summits(scene: SceneSections, key: str, why: str, other: str = "") -> Iterator[Refusal]:
    """Yield a key that micro models of summits have no use for, and why."""
    if (model := scene.micro.model) != "half-space":
        problem = f"does not go with micro.model = '{model}', which {why}"
        yield key, problem, f"{_CELLS}; or {other}" if other else _CELLS


def _bodies(scene: SceneSections) -> Iterator[Refusal]:
    block, samples = scene.block, scene.law.representative
    if block is None and scene.body is None:
        yield "block", "is required and missing", "[block]; or [body], of a mesh"
    if block is not None and scene.body is not None:
        yield "body", "is a second body below the surface", "either [block] or [body]"
    if block is not None and samples and block.lengths is None:
        sides = "the sides of the block along x and y"
        yield "block.lengths", f"is required with {_SAMPLES}, whose surface is a sample", sides
    if block is not None and block.lengths is not None and not samples:
        own = "the sides of the block are those of the surface, and block.margin"
        yield "block.lengths", f"needs {_SAMPLES}", f"{_OUT}; {own}"


def _body_loads(scene: SceneSections) -> Iterator[Refusal]:
    """Yield loads of bodies that are not there, and what does not know of them."""
    sections = {"body": scene.body, "counter_body": scene.counter_body}
    for number, stage in enumerate(scene.loading.stage):
        for name, section in sections.items():
            loads, key = getattr(stage, name), f"load.stage.{number}.{name}"
            if loads is None:
                continue
            if section is None or section.mesh is None:
                yield key, f"loads a mesh, and there is no [{name}] of one", f"[{name}] with a mesh"
            else:
                section.check_expands(loads, f"{key}.temperature")
    if scene.counter_body is not None and scene.counter_body.pretension:
        yield (
            "counter_body.pretension",
            "bolts pull the body towards the counter-body, whose supports move with them",
            "body.pretension; what bolts do to the counter-body is one of its tractions",
        )
    if scene.loads_bodies and not scene.by_laws:
        reason = "loads of the body besides the contact need laws on its mesh"
        ways = f"coupling.kind = 'consistent' or 'isolated'; or {_SAMPLES}"
        yield "coupling.kind", f"is '{scene.kind}', but {reason}", ways
    if scene.loads_bodies and not scene.law.representative and scene.output.asks_for_contact:
        problem = "the contact problem behind laws does not know of loads of the body"
        yield "output.contact", problem, "'none' or 'auto'; or no loads of the body"


def _surfaces(scene: SceneSections) -> Iterator[Refusal]:
    """Yield what does not fit of periodic surfaces, where something ends or turns, and two."""
    kind, model, tilt = scene.coupling.kind, scene.micro.model, scene.loading.tilt
    alone = (kind, model, tilt) == ("analytic", "half-space", (0, 0))
    if scene.surface.periodic and not (scene.law.representative or alone):
        yield (
            "surface.periodic",
            "a body or a plane that turns does not continue periodically",
            f"coupling.kind = 'analytic', {_CELLS}, a level plane; or {_SAMPLES}",
        )
    other = scene.counter_surface
    chosen = scene.accuracy is not None and other is None
    maps = [("law.regions", region) for region in scene.law.regions]
    for key, one in [("surface", scene.surface), ("counter_surface", other), *maps]:
        if one is not None and one.lacks_grid and not (chosen and key == "surface"):
            yield key, "a 'spectrum' needs 'grid' and 'lengths' beside it", ""
    if other is not None and other.periodic != scene.surface.periodic:
        yield "counter_surface.periodic", "is not surface.periodic", "both, or neither"


def _couplings(scene: SceneSections) -> Iterator[Refusal]:
    """Yield what a coupling has no use for, and what it leaves out."""
    for key, (kinds, reason) in _WITHOUT.items():
        name, _, field = key.partition(".")
        section = getattr(scene, name)
        if (getattr(section, field) if field else section) is None or scene.kind not in kinds:
            continue
        others = ("concurrent", "consistent", "isolated", "analytic")
        allowed = " or ".join(repr(one) for one in others if one not in kinds)
        problem = f"does not go with coupling.kind = '{scene.kind}', {reason}"
        yield key, problem, f"coupling.kind = {allowed}"
    second = scene.counter_body
    if second is not None and second.mesh is None and scene.kind in ("isolated", "representative"):
        laws = "laws of samples" if scene.law.representative else "isolated laws"
        problem = f"is a half-space, which {laws} do not know"
        yield "counter_body", problem, "a meshed block in its place, counter_body.mesh"


def _samples(scene: SceneSections, of_coupling: Iterable[str]) -> Iterator[Refusal]:
    """Yield what a law of a periodic sample has no use for."""
    law, goes = scene.law, f"does not go with {_SAMPLES}"
    values, default = asdict(scene.coupling), asdict(type(scene.coupling)())
    stated = set(of_coupling)
    if stated >= {key for key, value in values.items() if value is not None}:  # written whole
        stated = {key for key in stated if values[key] != default[key]}
    for key in sorted(stated - {"table_tolerance"}):
        yield f"coupling.{key}", f"{goes}, which stands at points", _OUT
    if scene.patches != type(scene.patches)():
        yield "patches.grid", f"{goes}, which has no patches", _OUT
    if scene.micro.model != "half-space":
        yield "micro.model", goes, "'half-space'"
    if scene.output.asks_for_contact:
        yield "output.contact", f"{goes}, which has no spots", _OUT
    if law.seeds and scene.surface.spectrum is None:
        yield "law.seeds", "needs surface.spectrum", "law.samples, which names further maps"
    if law.samples and scene.surface.file is None:
        yield "law.samples", "needs surface.file", "law.seeds for a spectrum"
    if scene.block is not None and law.regions:
        yield "law.regions", "names faces of a mesh", "with [body]"
    if scene.body is not None and scene.body.place is not None:
        yield "body.place", f"{goes}, whose sample has no place", _OUT


def _cells(scene: SceneSections) -> Iterator[Refusal]:
    """Yield cells of contact problems where there are none."""
    without = {
        f"micro.model = '{scene.micro.model}'": scene.micro.model != "half-space",
        "coupling.kind = 'reference'": scene.kind == "reference",
        _SAMPLES: scene.law.representative,
    }
    for other in (name for name, has_none in without.items() if has_none):
        yield "micro.cells", f"does not go with {other}, which has no such cells", _OUT
    if scene.surface.lacks_grid:
        yield "micro.cells", "needs surface.grid", f"surface.grid beside it; or {_OUT}"


def _hardness(scene: SceneSections) -> Iterator[Refusal]:
    """Yield what micro models, and patch laws that stand for them, do not know of yielding."""
    yield from _summits(scene, scene.hardness_key, "has no cells to yield")
    if scene.loading.unloads and scene.by_laws:
        yield scene.hardness_key, *TURNS_BACK


def _lacking(scene: SceneSections) -> Iterator[Refusal]:
    """Yield what has no effect without a section that is not there."""
    loading, coefficient = scene.loading, "[wear] with a coefficient"
    rubs = (n for n, region in enumerate(scene.law.regions) if region.friction is not None)
    wears = any(region.wear is not None for region in scene.law.regions)
    if scene.leak is None and scene.law.axes is not None:
        yield "law.axes", "has no effect without a leak", f"[leak] beside it; or {_OUT}"
    if scene.friction is None:
        allowed = "[friction] with a coefficient, which holds on all other regions"
        yield from ((f"law.regions.{n}.friction", "needs [friction]", allowed) for n in rubs)
        if loading.shear_key:
            key = "load.stage" if loading.stage else f"load.{loading.shear_key}"
            yield key, "needs friction", "friction.coefficient, as in 0.3"
    if scene.wear is None and wears:
        yield "law.regions", "'wear' needs the section [wear]", coefficient
    if scene.wear is None and loading.slides:
        yield "load.sliding", "changes nothing without wear", coefficient


def _leak(scene: SceneSections) -> Iterator[Refusal]:
    """Yield gaps that are not known, and edges of faces that there are none of."""
    leak = scene.leak
    assert leak is not None, "a rule of this section"
    if leak.between_edges and (scene.body is None or not scene.law.representative):
        problem = f"needs {_SAMPLES} on a [body], whose face has edges"
        yield "leak.inlet", problem, "leave out both edges"
    if scene.law.representative and not leak.between_edges:
        problem = f"is required with {_SAMPLES}: the fluid flows over the face"
        yield "leak.inlet", problem, "leak.inlet and leak.outlet, faces of a [body]"
    yield from _summits(scene, "leak", "knows no gaps beside summits")


def _conductance(scene: SceneSections) -> Iterator[Refusal]:
    """Yield contacts whose stiffness says nothing of what they conduct."""
    if (key := scene.hardness_key) and scene.by_laws:
        yield (
            "conductance",
            f"does not go with {key} where patch laws stand for the contact: their "
            "stiffness is that of contacts that yield, which conduct all the same",
            _CONCURRENT,
        )
    if not scene.by_laws:
        laws = "coupling.kind = 'consistent' or 'isolated'"
        yield from _summits(scene, "conductance", "tells none without laws", laws)


def _friction(scene: SceneSections) -> Iterator[Refusal]:
    """Yield what has no friction, friction without effect, and loads that it does not bear."""
    friction = scene.friction
    assert friction is not None, "a rule of this section"
    if scene.rubs_on_mesh:
        if friction.coupled:
            problem = (
                "is true, but laws do not know how pressures of single contacts pull the surface"
            )
            yield "friction.coupled", problem, f"false; or {_CONCURRENT} or 'analytic'"
        if scene.output.asks_for_contact:
            problem = "the contact problem behind laws does not know what has slipped under them"
            yield "output.contact", problem, f"'none' or 'auto'; or {_CONCURRENT}"
    elif scene.kind not in ("concurrent", "analytic") and not scene.by_laws:
        kind = f"coupling.kind = '{scene.coupling.kind}'"
        problem = f"does not go with {kind}, which has no tangential tractions"
        yield "friction", problem, "another coupling.kind, or laws of samples"
    elif scene.micro.model != "half-space":
        yield from _summits(scene, "friction", "has no cells", "laws")
    elif not (scene.loading.shear_key or scene.loading.slides):
        problem = "has no effect without shear"
        yield "friction", problem, "load.shear, load.shear_force or load.sliding beside it"
    elif friction.coupled and not scene.loading.shear_key:
        problem = "is true, but faces that slide as wholes do not know how tractions lift them"
        yield "friction.coupled", problem, "false"
    if friction.speed is not None and not scene.loading.slides:
        problem = "has no effect where nothing slides"
        yield "friction.speed", problem, "load.sliding beside it"
    loading = scene.loading
    if loading.shear_force is None or loading.force is None or scene.loads_bodies:
        return  # bolts press as well
    along = loading.shear_path == "along"
    forces = loading.force if along else [loading.force[-1]] * len(loading.shear_force)
    for pair, force in zip(loading.shear_force, forces, strict=True):
        most = max(scene.coefficients) * force
        if hypot(*pair) >= most:
            problem = f"slides: friction transmits less than {most:.6g} N under {force:.6g} N"
            yield "load.shear_force", problem, f"pairs shorter than {most:.6g} N; or load.shear"


def _wear(scene: SceneSections) -> Iterator[Refusal]:
    """Yield wear where nothing slides, and what does not wear."""
    slides, slips = scene.loading.slides, scene.friction and scene.loading.shear_key
    if not (slides or slips):
        allowed = "load.sliding = '100 m'; or [friction] with load.shear or load.shear_force"
        yield "wear", "has no effect where nothing slides", allowed
    if slides and slips:
        problem = "does not go with a shear: faces that slide as wholes slip everywhere"
        yield "load.sliding", problem, f"either of load.sliding and load.{slips}"
    if scene.kind not in ("concurrent", "analytic", "consistent", "representative"):
        problem = (
            f"does not go with coupling.kind = '{scene.kind}', whose roughness does not run in"
        )
        yield "wear", problem, f"coupling.kind = 'concurrent' or 'consistent'; or {_SAMPLES}"
    if scene.by_laws:
        whole, points = not scene.law.representative, scene.coupling.interface == "pointwise"
        out = f"{_OUT}; or coupling.kind = 'concurrent'" if whole else _OUT
        for key, stated, reason in (
            ("accuracy", scene.accuracy is not None, "it is kept of new faces alone"),
            ("a shear", whole and bool(slips), "they do not tell how far single contacts slip"),
            ("loads of the body", whole and scene.loads_bodies, "single cells wear without them"),
            ("coupling.interface = 'pointwise'", whole and points, "they wear by patches"),
        ):
            if stated:
                yield "wear", f"does not go with {key} under laws: {reason}", out
    yield from _summits(scene, "wear", "has no cells")
    if scene.counter_surface is not None:
        problem = "does not go with a rough counter surface, whose summits slide along"
        yield "wear", problem, "leave [counter_surface] out"


def _vibration(scene: SceneSections) -> Iterator[Refusal]:
    """Yield couplings without a body that has mass, and directions in which nothing rubs."""
    section = scene.vibration
    assert section is not None, "a rule of this section"
    if not scene.by_laws:
        yield (
            "vibration",
            f"does not go with coupling.kind = '{scene.kind}', whose body has no mesh with a mass",
            f"coupling.kind = 'consistent' or 'isolated'; or {_SAMPLES}",
        )
    second = scene.counter_body
    if second is not None and second.mesh is None:
        yield (
            "counter_body",
            "is a half-space, which has no mass that vibrates",
            "counter_body.mesh; or a rigid plane, without [counter_body]",
        )
    if second is not None and section.plane != "held":
        yield "vibration.plane", "is there no plane beside a counter-body", "'held'"
    if scene.block is not None and scene.block.density is None:
        yield "block.density", "is required and missing beside [vibration]", '"7850 kg/m^3"'
    for name, one in (("body", scene.body), ("counter_body", second)):
        if one is not None and (key := one.without_density):
            missing = "is required and missing beside [vibration]"
            yield f"{name}.{key}", missing, '"7850 kg/m^3"'
    if section.sliding is not None and scene.friction is None:
        yield "vibration.sliding", "needs friction", "friction.coefficient, as in 0.3"
