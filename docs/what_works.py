"""Writes the page on what works with what, from what the code itself refuses.

    .venv/bin/python docs/what_works.py

Small scenes of every coupling on a block and on a mesh are planned, each with one more choice, and
with two. What is refused stands on the page in the words of the refusal, less the names in it. A
new choice is a line of `CHOICES`.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from itertools import combinations, groupby
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from patchlaw.multiscale import Scene
from patchlaw.multiscale.bodies.reader import read_bodies
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.multiscale.models.setup import trial_coupling
from patchlaw.support import InputError, NotConverged

PAGE = Path(__file__).with_suffix(".md")

Changes = Mapping[str, Any]

AS_SURFACE = "as the surface"
"""Value of a section that is a copy of ``[surface]``."""
A_MAP, ANOTHER_MAP = "a map.txt", "another map.txt"
"""Files of heights in the folder of the meshes."""

COUPLINGS: dict[str, Changes] = {
    "`analytic`": {"coupling.kind": "analytic"},
    "`concurrent`": {"coupling.kind": "concurrent"},
    "`consistent`": {"coupling.kind": "consistent"},
    "`isolated`": {"coupling.kind": "isolated"},
    "laws of samples": {"law.kind": "representative"},
    "`reference`": {"coupling.kind": "reference"},
}
"""Columns: the couplings, and laws of periodic samples (``law.kind = "representative"``)."""

BODIES: dict[str, dict[str, Changes]] = {
    "block": {"laws of samples": {"block.lengths": [2.0, 2.0]}},
    "body": {},
}
"""Sections of the first body, and what single couplings need there."""

CHOICES: dict[str, dict[str, Changes]] = {
    "Contact": {
        '`micro.model = "elliptic"` (asperities)': {"micro.model": "elliptic"},
        "`micro.finite_slopes = true`": {"micro.finite_slopes": True},
        "`micro.hardness`": {"micro.hardness": 600.0},
        "`[counter_surface]` (two rough sides)": {"counter_surface": AS_SURFACE},
        "`surface.periodic = true`": {"surface.periodic": True},
    },
    "Bodies": {
        "`[counter_body]` (a half-space)": {
            "counter_body": {"young_modulus": 4000.0, "poisson_ratio": 0.3}
        },
        "`counter_body.mesh`": {"counter_body": "a mesh"},
        '`block.sides = "roller"`': {"block.sides": "roller"},
        "`block.margin`": {"block.margin": 0.5},
        "`body.tractions`": {"body.tractions": [{"surface": "side", "stress": [0.0, 0.0, 1.0]}]},
        "`body.temperature`": {"body.temperature": 10.0, "body.thermal_expansion": 1e-5},
    },
    "Laws": {
        '`coupling.interface = "pointwise"`': {"coupling.interface": "pointwise"},
        "`law.seeds` (scatter of samples)": {"law.seeds": [1, 2]},
        "`law.samples` (further maps)": {
            "surface.spectrum": None,
            "surface.grid": None,
            "surface.file": A_MAP,
            "surface.height_unit": "mm",
            "law.samples": [ANOTHER_MAP],
        },
        "`law.crown`": {"law.crown": [100.0, "inf"]},
    },
    "Load": {
        "`load.force`": {"load.approach": None, "load.force": 1.0},
        "`load.pressure`": {"load.approach": None, "load.pressure": 1.0},
        "`[[load.stage]]`": {
            "load.approach": None,
            "load.stage": [{"approach": 4e-3}, {"force": 1.0}],
        },
        "`[friction]`, `load.shear`": {"friction.coefficient": 0.3, "load.shear": [1e-3, 0.0]},
        "`friction.coupled = true`": {
            "friction.coefficient": 0.3,
            "friction.coupled": True,
            "load.shear": [1e-3, 0.0],
        },
        "`load.tilt = [tx, ty]`": {"load.tilt": [1e-3, 0.0]},
        '`load.tilt = "free"`': {"load.tilt": "free"},
        "`load.approach = [up, down]`": {"load.approach": [8e-3, 2e-3]},
        '`load.zero = "mean plane"`': {"load.zero": "mean plane", "load.approach": -0.01},
        "`accuracy`": {"accuracy": 0.4},
    },
    "Results": {
        '`output.contact = "all"` (spots, maps)': {"output.contact": "all"},
        "`output.fields`": {"output.fields": True},
        "`[conductance]`": {"conductance": {"conductivity": [50.0]}},
        "`[leak]` (through gaps of cells)": {"leak": {"viscosity": 1e-3, "pressures": [0.2, 0.1]}},
        "`[wear]`": {"wear": {"coefficient": 1e-8}, "load.sliding": [1e3]},
        "`[vibration]` (natural modes)": {"vibration": {"modes": 4}},
    },
}
"""Rows: the choices by topic, each with the keys that make it; None takes a key away."""

STATED, OF_BODIES = ("coupling.",), ("block.", "body.", "output.fields")
"""Beginnings of keys that a plan states where they matter, and of those that matter with a body."""

ERROR, LAWS = "error measured in the run", "`patchlaw laws` (for other programs)"
"""Rows that are read off the plan itself."""

INTRO = """# What works with what

`docs/what_works.py` writes this page from what the code refuses; a refusal also says what would do
instead. Columns are values of `coupling.kind`, and laws of samples (`law.kind = "representative"`).

## One choice

● works, ○ is accepted and changes nothing, a number is that of a [reason](#reasons). Two signs are
those on a block (`[block]`) and on a mesh (`[body]`); one sign is that of both.
"""
EVERYWHERE = "These work with every coupling: {}.\n"
PAIRS = """## Two choices together

Choices that each work with a coupling, but not together:
"""

NAMES = (
    (r"coupling\.kind = '\w+'", "this coupling"),
    (r"^\w+ = '[\w-]+' does not go with kind = '\w+'", "does not go with this coupling"),
    (r"^is ('\w+'|true), but ", ""),
    (r"^'\w+' needs kind", "needs law.kind"),
)
"""Names in the words of a refusal, and what stands on the page in their place."""


class Reason(NamedTuple):
    """Why something does not work.

    Attributes:
        problem: What is wrong.
    """

    problem: str

    @classmethod
    def of(cls, error: InputError) -> Reason:
        """Return the reason of a refusal, without the names of what it refuses."""
        text = error.problem
        for pattern, instead in NAMES:
            text = re.sub(pattern, instead, text)
        return cls(f"`{error.key}` {text}" if text.startswith("is required") else text)


class Planner:
    """Plans scenes of couplings and bodies with further choices.

    Args:
        folder: Where meshes are written.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        wave = np.cos(2.0 * np.pi * (np.arange(16) + 0.5) / 16)
        np.savetxt(folder / A_MAP, 0.02 * np.outer(wave, wave))
        np.savetxt(folder / ANOTHER_MAP, 0.018 * np.outer(wave, wave))
        write_mesh(folder / "below.msh", 0.0, 1.0, contact_above=True)
        write_mesh(folder / "above.msh", 1.0, 2.0, contact_above=False)

    def scene(self, coupling: str, body: str, *choices: Changes) -> Scene:
        """Return a scene.

        Args:
            coupling: A name of `COUPLINGS`.
            body: A name of `BODIES`.
            *choices: What is changed of it.

        Raises:
            InputError: When the scene is refused.
        """
        material = {"young_modulus": 4000.0, "poisson_ratio": 0.3, "density": 1e-9}
        data: dict[str, Any] = {
            "surface": {
                "spectrum": {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.2, "seed": 1},
                "grid": [16, 16],
                "lengths": [1.0, 1.0],
            },
            "load": {"approach": 8e-3, "steps": 1},
            "block": {"height": 1.0, **material},
        }
        if body == "body":
            del data["block"]
            supports = [{"surface": "far", "displacement": [0.0, 0.0, 0.0]}]
            data["body"] = {
                "mesh": str(self._folder / "below.msh"), "contact": "near",
                "supports": supports, **material,
            }  # fmt: skip
        changes = [COUPLINGS[coupling], BODIES[body].get(coupling, {}), *choices]
        pairs = [pair for one in changes for pair in one.items()]
        for key, value in sorted(pairs, key=lambda pair: pair[1] == AS_SURFACE):
            self._put(data, key, value)
        return Scene.from_dict(data)

    def _put(self, data: dict[str, Any], key: str, value: Any) -> None:
        """Set a key of a scene, or take it away."""
        *sections, name = key.split(".")
        for section in sections:
            data = data.setdefault(section, {})
        if value is None:
            data.pop(name, None)
        elif value == A_MAP:
            data[name] = str(self._folder / value)
        elif value == [ANOTHER_MAP]:
            data[name] = [str(self._folder / ANOTHER_MAP)]
        elif value == AS_SURFACE:
            data[name] = {**data["surface"]}
        elif value == "a mesh":
            supports = [{"surface": "far", "displacement": [0.0, 0.0, 0.0]}]
            data[name] = {
                "mesh": str(self._folder / "above.msh"), "contact": "near", "supports": supports,
                "young_modulus": 4000.0, "poisson_ratio": 0.3, "density": 1e-9,
            }  # fmt: skip
        else:
            data[name] = value

    def planned(self, coupling: str, body: str, *choices: Changes) -> Any:
        """Return the coupling that a scene makes, or why there is none.

        Args:
            coupling: A name of `COUPLINGS`.
            body: A name of `BODIES`.
            *choices: What is changed of the scene.
        """
        try:
            scene = self.scene(coupling, body, *choices)
            return trial_coupling(scene, None, ClusterNodes(), read_bodies)
        except InputError as error:
            return Reason.of(error)
        except NotConverged as error:
            return Reason(str(error))

    def error(self, coupling: str, body: str) -> Reason | None:
        """Return why a coupling measures no error; None where it does."""
        made = self.planned(coupling, body)
        if isinstance(made, Reason):
            return made
        why = made.about.unmeasured()
        return Reason(f"no error is measured: {why}") if why else None

    def laws(self, coupling: str, body: str) -> Reason | None:
        """Return why a coupling has no laws; None where it has."""
        scene = self.scene(coupling, body)
        try:
            scene.check_has_laws()
        except InputError as error:
            return Reason.of(error)
        return None


def write_mesh(path: Path, low: float, high: float, *, contact_above: bool) -> None:
    """Write a cube of tetrahedra with named faces: near and far from the contact, one side.

    Args:
        path: The file.
        low: Lowest z [mm].
        high: Highest z [mm].
        contact_above: Whether the upper face is the near one.
    """
    ends = {"near": high if contact_above else low, "far": low if contact_above else high}
    corners = [(x, y, z) for z in (low, high) for y in (0.0, 1.0) for x in (0.0, 1.0)]
    squares = {name: [k + 1 for k, corner in enumerate(corners) if corner[2] == z]
               for name, z in ends.items()}  # fmt: skip
    squares["side"] = [k + 1 for k, corner in enumerate(corners) if corner[0] == 0.0]
    triangles = [(tag, (a, b, c)) for tag, (a, b, d, c) in enumerate(squares.values(), 1)
                 for a, b, c in ((a, b, c), (a, c, d))]  # fmt: skip
    # six tetrahedra about the diagonal from the first corner to the last
    ways = ((2, 4), (4, 3), (3, 7), (7, 5), (5, 6), (6, 2))
    cells = [(9, (1, second, third, 8)) for second, third in ways]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "4"]
    lines += [f'2 {tag} "{name}"' for tag, name in enumerate(squares, 1)]
    lines += ['3 9 "cube"', "$EndPhysicalNames", "$Nodes", "8"]
    lines += [f"{k + 1} {x:g} {y:g} {z:g}" for k, (x, y, z) in enumerate(corners)]
    lines += ["$EndNodes", "$Elements", str(len(triangles) + len(cells))]
    for number, (tag, nodes) in enumerate([*triangles, *cells], 1):
        kind = {3: 2, 4: 4}[len(nodes)]
        lines.append(f"{number} {kind} 2 {tag} {tag} {' '.join(map(str, nodes))}")
    path.write_text("\n".join([*lines, "$EndElements", ""]), encoding="utf-8")


class Reasons(dict[Reason, int]):
    """Numbers of reasons, from 1, in the order in which they are first met."""

    def cell(self, reason: Reason | None) -> str:
        """Return what stands in a cell of the tables."""
        if reason is None:
            return "●"
        return str(self.setdefault(reason, len(self) + 1))


def page(*, pairs: bool = True) -> str:
    """Return the page.

    Args:
        pairs: Whether it has what does not go together, which takes a minute.
    """
    with tempfile.TemporaryDirectory() as folder:
        planner, reasons = Planner(Path(folder)), Reasons()
        works: dict[tuple[str, str], list[str]] = {}
        parts = [INTRO, _table(planner, reasons, works)]
        if pairs:
            parts += [PAIRS, _pairs(planner, reasons, works)]
    listed = "".join(f"{number}. {reason.problem}\n" for reason, number in reasons.items())
    return "\n".join([*parts, "## Reasons\n", listed])


def _table(planner: Planner, reasons: Reasons, works: dict[tuple[str, str], list[str]]) -> str:
    """Return the table of choices by topic, and note which of them work."""
    rows: list[tuple[str, list[str]]] = []
    bare = {(one, body): planner.planned(one, body) for one in COUPLINGS for body in BODIES}
    for topic, choices in CHOICES.items():
        rows.append((f"**{topic}**", [""] * len(COUPLINGS)))
        if topic == "Results":
            rows.append((ERROR, _row(lambda *at: reasons.cell(planner.error(*at)), BODIES)))
            rows.append((LAWS, _row(lambda *at: reasons.cell(_laws(planner, *at)), BODIES)))
        for name, changes in choices.items():
            bodies = [body for body in BODIES if name.startswith(f"`{body}.")] or BODIES

            def cell(coupling: str, body: str, name: str = name, changes: Changes = changes) -> str:
                made = bare[coupling, body]
                if not isinstance(made, Reason):
                    made = planner.planned(coupling, body, changes)
                if isinstance(made, Reason):
                    return reasons.cell(made)
                works.setdefault((coupling, body), []).append(name)
                return "○" if _changes_nothing(changes, made, bare[coupling, body]) else "●"

            rows.append((name, _row(cell, bodies)))
    everywhere = [name for name, cells in rows if set(cells) == {"●"}]
    lines = [f"| | {' | '.join(COUPLINGS)} |\n|---|{':-:|' * len(COUPLINGS)}\n"]
    refused = [(name, cells) for name, cells in rows if name not in everywhere]
    for cells, alike in groupby(refused, key=lambda row: row[1]):
        lines.append(f"| {'; '.join(name for name, _ in alike)} | {' | '.join(cells)} |\n")
    return "\n".join([fill(EVERYWHERE.format(", ".join(everywhere)), 100) + "\n", "".join(lines)])


def _laws(planner: Planner, coupling: str, body: str) -> Reason | None:
    try:
        return planner.laws(coupling, body)
    except InputError as error:
        return Reason.of(error)


def _changes_nothing(changes: Changes, made: Any, bare: Any) -> bool:
    """Tell whether a choice that is accepted changes nothing: a default, or not looked at."""
    if all(key.startswith(OF_BODIES) for key in changes):
        return not made.scene.has_body
    if all(key.startswith(STATED) for key in changes):
        return list(made.about.statements()) == list(bare.about.statements())
    return False


def _row(cell: Callable[[str, str], str], bodies: Iterable[str]) -> list[str]:
    """Return for every coupling what stands there on each body, once if it is the same."""
    return [" ".join(dict.fromkeys(cell(one, body) for body in bodies)) for one in COUPLINGS]


def _pairs(planner: Planner, reasons: Reasons, works: Mapping[tuple[str, str], list[str]]) -> str:
    """Return the table of pairs of choices that work alone but not together."""
    changes = {name: one for choices in CHOICES.values() for name, one in choices.items()}
    found: dict[tuple[str, str, Reason], list[str]] = {}
    for (coupling, body), names in works.items():
        for first, second in combinations(names, 2):
            if set(changes[first]) & set(changes[second]):
                continue  # one would replace the other
            made = planner.planned(coupling, body, changes[first], changes[second])
            if isinstance(made, Reason):
                where = found.setdefault((first, second, made), [])
                if coupling not in where:
                    where.append(coupling)
    seconds: dict[tuple[str, Reason, str], list[str]] = {}
    for (first, second, reason), where in found.items():
        seconds.setdefault((first, reason, ", ".join(where)), []).append(second)
    firsts: dict[tuple[str, Reason, str], list[str]] = {}
    for (first, reason, where), others in seconds.items():
        firsts.setdefault(("; ".join(others), reason, where), []).append(first)
    lines = ["| choice | with | in | reason |\n|---|---|---|:-:|\n"]
    for (others, reason, where), names in firsts.items():
        lines.append(f"| {'; '.join(names)} | {others} | {where} | {reasons.cell(reason)} |\n")
    return "".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
