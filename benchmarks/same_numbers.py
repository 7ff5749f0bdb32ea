"""Compare the numbers of some sixty problems between two checkouts, one by one.

    python benchmarks/same_numbers.py store before.json CHECKOUT   # with its own .venv
    python benchmarks/same_numbers.py store after.json .
    python benchmarks/same_numbers.py compare before.json after.json

The scenes cover all couplings, micro models, bodies, stages, controls, hardness, conductance,
friction, leaks, counter-bodies and laws; some of them run on two ranks too, or are killed and
resumed. Beside them are the README's own dolfinx problem and others on its pad: friction, patches,
a hyperelastic pad, two faces. Numbers are all of `LoadStep` but times and iterations, those of
patches and leaks included, or of the tables that the command writes. The cache is off. Only public
names and the command line are used, so that checkouts may differ in all else.
"""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

SCENES_FOLDER = "demos/scenes"
SURFACE = {
    "spectrum": {"hurst": 0.9, "waves": [2, 5], "rms_slope": 0.2, "seed": 3},
    "grid": [32, 32],
    "lengths": ["1 mm", "1 mm"],
}
COUNTER = {"spectrum": {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.1, "seed": 5}}
CONSTANTS = {"young_modulus": "4 GPa", "poisson_ratio": 0.15}
BLOCK = {**CONSTANTS, "cells": [8, 8, 5]}
HALF = {"model": "half-space"}
SLOPES = {"model": "half-space", "finite_slopes": True}
PATCHES = {"grid": [2, 4]}
APPROACH = {"approach": "8.013 um", "steps": 2}
FORCE = {"force": "4.117 N", "steps": 2}
FREE = {**FORCE, "tilt": "free"}
TILTED = {**APPROACH, "tilt": ["2.13 um/mm", "-1.07 um/mm"]}
CYCLE = {"approach": ["8.013 um", "3.1 um", "9.2 um"], "steps": 2}
CHECKED = {"check": "all"}
HEAT = {
    "conductivity": ["50 W/m/K"], "resistivity": ["1.7e-7 ohm m"], "gas": "0.026 W/m/K",
    "temperature_jump": "0.4 um",
}  # fmt: skip
OIL = {"viscosity": "10 mPa s", "pressures": ["5 bar", "1 bar"]}
RUBS = {"friction": {"coefficient": 0.3}}
SHEARED = {**FORCE, "shear": [["0.4 um", "0.1 um"], ["-0.2 um", "0"]], "shear_steps": 2}
LAW = {"kind": "representative"}
SAMPLE = {**SURFACE, "grid": [16, 16], "lengths": ["0.1 mm", "0.1 mm"]}


def scene(kind, micro=HALF, load=APPROACH, output=None, coupling=None, **sections):
    """Return the sections of a scene; a None takes one out."""
    whole = {
        "surface": SURFACE,
        "block": BLOCK,
        "patches": PATCHES,
        "micro": micro,
        "coupling": {"kind": kind, **(coupling or {})},
        "load": load,
        "output": {"figures": False, "report": False, "check": "none", **(output or {})},
        **sections,
    }
    return {name: section for name, section in whole.items() if section is not None}


def sampled(**sections):
    """Return the sections of a scene with a law of samples."""
    block = {**BLOCK, "lengths": ["1 mm", "1 mm"], "height": "1 mm"}
    given = {"surface": SAMPLE, "law": LAW, "patches": None, "block": block, **sections}
    whole = scene("", **given)
    del whole["coupling"]
    return whole


def scenes(folder):
    """Yield the names and sections of the scenes; bodies' meshes stand in a folder."""
    body = {"mesh": f"{folder}/cube.msh", "contact": "top", "supports": [{"surface": "bottom"}]}
    above = {"mesh": f"{folder}/above.msh", "contact": "bottom", "supports": [{"surface": "top"}]}
    body, above = {"body": body | CONSTANTS, "block": None}, above | CONSTANTS
    steel = {"young_modulus": "210 GPa", "poisson_ratio": 0.3}
    models = ("elliptic", "circular", "elliptic-independent", "circular-independent")
    fine = {"surface": {**SURFACE, "grid": [64, 64]}}
    for model in models:
        yield f"analytic {model}", scene("analytic", {"model": model}, **fine)
    yield "analytic slopes", scene("analytic", SLOPES, TILTED, CHECKED)
    yield "analytic hardness", scene("analytic", {**HALF, "hardness": "312.7 MPa"}, CYCLE)
    yield "analytic periodic", scene("analytic", surface={**SURFACE, "periodic": True}, load=FORCE)
    yield "analytic free", scene("analytic", load=FREE)
    yield "analytic heat", scene("analytic", load=FORCE, conductance=HEAT)
    yield "analytic zero", scene("analytic", load={**APPROACH, "zero": "mean plane"})
    yield "concurrent", scene("concurrent", output={**CHECKED, "contact": "all"})
    yield "concurrent hardness", scene("concurrent", {**HALF, "hardness": "312.7 MPa"}, CYCLE)
    yield "concurrent free", scene("concurrent", load=FREE, output=CHECKED)
    yield "concurrent roller", scene("concurrent", block={**BLOCK, "sides": "roller"}, load=TILTED)
    yield "concurrent margin", scene("concurrent", block={**BLOCK, "margin": "0.2 mm"})
    yield "concurrent elliptic", scene("concurrent", {"model": "elliptic"}, **fine)
    yield (
        "concurrent two sides",
        scene("concurrent", SLOPES, counter_surface={**SURFACE, **COUNTER}, counter_body=steel),
    )
    yield "concurrent heat", scene("concurrent", conductance=HEAT, load=CYCLE)
    yield "consistent", scene("consistent", output={**CHECKED, "contact": "last"})
    yield "consistent tilted", scene("consistent", load=TILTED)
    yield "consistent points", scene("consistent", coupling={"interface": "pointwise"}, load=FORCE)
    yield "consistent free", scene("consistent", load=FREE)
    yield "consistent circular", scene("consistent", {"model": "circular"}, load=FORCE, **fine)
    yield "consistent hardness", scene("consistent", {**HALF, "hardness": "312.7 MPa"})
    yield "consistent counter-body", scene("consistent", counter_body=steel, conductance=HEAT)
    yield "isolated", scene("isolated", {"model": "circular"}, **fine)
    yield "isolated cells", scene("isolated", coupling={"love": "centre"}, load=FORCE)
    yield "isolated free", scene("isolated", load=FREE)
    tetrahedra = {**BLOCK, "element": "P1"}
    yield "isolated tetrahedra", scene("isolated", {"model": "circular"}, block=tetrahedra, **fine)
    meshes = {"fine": "60 um", "meshes": 2}
    yield "reference", scene("reference", reference=meshes, output={"contact": "last"})
    lagrangian = {**meshes, "method": "augmented-lagrangian"}
    yield "reference Lagrangian", scene("reference", reference=lagrangian)
    one = {**meshes, "meshes": 1}
    yield "reference free", scene("reference", reference=one, load=FREE)
    yield "representative", sampled(load={**FORCE, "force": "40.3 N"}, conductance=HEAT)
    yield "representative crown", sampled(load=APPROACH, law={**LAW, "crown": ["50 mm", "80 mm"]})
    yield "representative seeds", sampled(load=FREE, law={**LAW, "seeds": [1, 2]})
    yield "representative body", sampled(load={**FREE, "force": "41.7 N"}, **body)
    yield "representative pair", sampled(load=FORCE, counter_body=above, **body)
    yield "body concurrent", scene("concurrent", SLOPES, output=CHECKED, **body)
    yield "body consistent", scene("consistent", load=TILTED, **body)
    yield "body isolated", scene("isolated", load=FREE, **body)
    yield "body pair", scene("concurrent", load=FORCE, counter_body=above, **body)
    yield "concurrent friction", scene("concurrent", load=SHEARED, **RUBS)
    yield "consistent friction", scene("consistent", load=SHEARED, **RUBS)
    yield "representative friction", sampled(load=SHEARED, **RUBS, **body)
    hard = {**HALF, "hardness": "312.7 MPa"}
    pairs = [["0.1 um", "0"], ["0.2 um", "0.1 um"], ["0.1 um", "0"]]
    turned = {**CYCLE, "shear": pairs, "shear_path": "along"}
    yield "analytic friction", scene("analytic", hard, turned, CHECKED, **RUBS)
    yield "analytic leak", scene("analytic", hard, CYCLE, CHECKED, leak=OIL)
    yield "concurrent leak", scene("concurrent", output=CHECKED, leak=OIL)
    yield "consistent leak", scene("consistent", output=CHECKED, leak=OIL)
    over_face = {**OIL, "inlet": "left", "outlet": "right"}
    yield "face leak", sampled(load=FORCE, output=CHECKED, leak=over_face, **body)
    in_turn = {"stage": [
        {"name": "press", "force": "40.3 N", "steps": 2},
        {"name": "heat", "hold": "approach", "body": {"temperature": "20 K"}},
        {"name": "unload", "force": "11.7 N"},
    ]}  # fmt: skip
    heated = {"body": body["body"] | {"thermal_expansion": "1e-5 /K"}, "block": None}
    yield "stages of a body", sampled(load=in_turn, **heated)
    coupled = {"friction": {"coefficient": 0.3, "coupled": True}}
    yield "coupled friction", scene("analytic", load=SHEARED, **coupled)
    beside = {"counter_body": {"young_modulus": "8 GPa", "poisson_ratio": 0.3}}
    yield "body beside half-space", scene("concurrent", load=FORCE, **body, **beside)
    filtered = {"filter": {"short": "0.07 mm", "long": "0.8 mm"}, "detrend": "plane"}
    yield "prepared surface", scene("analytic", surface=SURFACE | filtered, load=FORCE)
    auto = scene("", accuracy=0.05, micro=None, block=CONSTANTS, patches=None, load=FORCE)
    del auto["coupling"]
    yield "accuracy", auto


def write_meshes(folder):
    """Write a cube below and one above the contact, by gmsh."""
    import gmsh

    for name, z in (("cube", 0.0), ("above", 1.0)):
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, z, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.setPhysicalName(3, gmsh.model.addPhysicalGroup(3, [1]), "body")
        sides = {"bottom": (-1, -1, z - 0.1, 2, 2, z + 0.1)}
        sides["top"] = (-1, -1, z + 0.9, 2, 2, z + 1.1)
        sides["left"] = (-0.1, -1, z - 1, 0.1, 2, z + 2)
        sides["right"] = (0.9, -1, z - 1, 1.1, 2, z + 2)
        for side, box in sides.items():
            faces = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*box, dim=2)]
            gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, faces), side)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
        gmsh.model.mesh.generate(3)
        gmsh.write(f"{folder}/{name}.msh")
        gmsh.finalize()


ON_RANKS = ("concurrent", "concurrent free", "body consistent", "reference",
            "representative body", "representative friction", "body pair", "concurrent friction",
            "face leak")  # fmt: skip
"""Scenes that two ranks solve too, by the command."""
RESUMED = "concurrent hardness", "consistent", "representative body", "concurrent friction"
"""Scenes that are killed after their second load step, and resumed."""


def python_of(page, marker):
    """Return the Python code of a page that has a text in it."""
    text = page.read_text(encoding="utf-8")
    (code,) = (part for part in text.split("```python\n")[1:] if marker in part.partition("```")[0])
    return code.partition("```")[0]


def of_interface(rough, u, *, rubs=False):
    """Return the numbers of an interface after its problem is solved."""
    values = {"force": [rough.force], "area": [rough.area], "moment": list(rough.moment),
              "plane": [rough.plane.approach, *rough.plane.tilt],
              "patches": rough.patch_pressure.tolist(),
              "displacement": [float(abs(u.x.array).sum())]}  # fmt: skip
    if rubs:
        values |= {"shear": list(rough.shear_force), "lost": [rough.dissipated]}
    return values


def own_problems(checkout):
    """Yield names of problems in dolfinx that users write, and what solves them."""
    names = {}

    def run(page, marker):
        exec(compile(python_of(checkout / page, marker), page, "exec"), names)

    def of_readme():
        run("README.md", "ContactProblem(")
        return of_interface(names["rough"], names["u"])

    def beside(solve):
        """Return a problem that goes on from the README's, which runs first where it did not."""
        return lambda: (names or of_readme()) and solve()

    def of_page():
        run("docs/own_problem.md", "Friction(")
        return of_interface(names["rough"], names["u"], rubs=True)

    def solved(*faces, residual=None, **options):
        """Solve the README's problem with other interfaces, and another residual."""
        import numpy as np

        from patchlaw import ContactProblem, Interface

        V, u, v, at = (names[name] for name in ("V", "u", "v", "at"))
        from dolfinx import fem

        held = fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(V, 2, at(10.0)), V)
        ufl = names["ufl"]
        u.x.array[:] = 0.0
        given = ufl.inner(names["stress"], ufl.sym(ufl.grad(v))) * ufl.dx
        roughs = [Interface(V, None, face, **{"laws": names["law"], **options, **one})
                  for face, one in faces]  # fmt: skip
        ContactProblem(residual or given, u, [held], roughs).solve()
        parts = [of_interface(rough, u) for rough in roughs]
        return {f"{k} {key}": value for k, part in enumerate(parts) for key, value in part.items()}

    def of_patches():
        from patchlaw import Control, PatchGrid

        patches = PatchGrid(grid=(4, 2), lengths=(40.0, 20.0))
        one = {"laws": [names["law"]] * 8, "patches": patches}
        return solved((names["at"](0.0), one), indenter=Control(force=700.0, tilt=None))

    def of_hyperelastic():
        from patchlaw import Control

        ufl, u, v, E = (names[name] for name in ("ufl", "u", "v", "E"))
        F = ufl.Identity(3) + ufl.grad(u)
        stress = E / 2.4 * (F - ufl.inv(F).T) + E / 6.0 * ufl.ln(ufl.det(F)) * ufl.inv(F).T
        residual = ufl.inner(stress, ufl.grad(v)) * ufl.dx
        one = names["at"](0.0), {"indenter": Control(force=800.0)}
        return solved(one, residual=residual)

    def of_two_faces():
        import numpy as np
        from dolfinx import mesh

        from patchlaw import Control

        side = mesh.locate_entities_boundary(names["pad"], 2, lambda x: np.isclose(x[0], 40.0))
        below = names["at"](0.0), {"indenter": Control(force=600.0)}
        return solved(below, (side, {"indenter": Control(approach=2.1e-3, tilt=(1e-5, 0.0))}))

    yield "README's problem", of_readme
    yield "own problem, friction", beside(of_page)
    yield "own problem, patches", beside(of_patches)
    yield "own problem, hyperelastic", beside(of_hyperelastic)
    yield "own problem, two faces", beside(of_two_faces)


def of_tables(folder):
    """Return the numbers of the tables of a run, by table and column."""
    values = {}
    for path in sorted(Path(folder).glob("*.csv")):
        with path.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        for name in rows[0] if rows else ():
            if name in ("wall_s", "newton_iterations", "linear_iterations"):
                continue
            try:
                values[f"{path.stem} {name}"] = [float(row[name]) for row in rows if row[name]]
            except ValueError:
                values[f"{path.stem} {name}"] = [float(sum(map(len, (r[name] for r in rows))))]
    return values


def in_toml(value):
    """Return a value as TOML, tables in one line."""
    if isinstance(value, dict):
        parts = (f"{json.dumps(key)} = {in_toml(one)}" for key, one in value.items())
        return f"{{ {', '.join(parts)} }}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(in_toml, value))}]"
    return json.dumps(value)


def by_command(sections, folder, *, ranks=1, killed=False):
    """Return the numbers of a scene that the command solves, on some ranks, or killed once."""
    path = Path(folder, "scene.toml")
    lines = (f"{name} = {in_toml(section)}" for name, section in sections.items())
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    command = [sys.executable, "-m", "patchlaw", "run", path.name, "--out", "out"]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), "--oversubscribe", *command]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1",
                                "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}  # fmt: skip
    given = {"cwd": folder, "env": environment, "text": True}
    out = Path(folder, "out")
    shutil.rmtree(out, ignore_errors=True)
    if killed:
        with subprocess.Popen(command, stdout=subprocess.PIPE, **given) as process:
            for line in process.stdout:
                if re.match(r"\s*2\s", line):  # the second load step
                    process.kill()
        if process.returncode == 0:
            raise RuntimeError("was not killed")
        command.append("--resume")
    done = subprocess.run(command, capture_output=True, check=False, **given)
    if done.returncode:
        raise RuntimeError(done.stderr.strip()[-300:])
    return of_tables(out)


def numbers(history):
    """Return all numbers of a history by name."""
    import dataclasses

    import numpy as np

    values = {}
    for step in history.steps:
        for field in dataclasses.fields(step):
            value = getattr(step, field.name)
            if field.name in ("wall_s", "reason", "warnings", "newton_iterations",
                              "linear_iterations"):  # fmt: skip
                continue
            if field.name == "control":  # whose other numbers the step has
                values[f"{step.step} body_state"] = [step.body_state]
                continue
            if field.name in ("errors", "shear_errors"):
                value = dict(value)
            elif field.name == "patches":
                value = {one.name: getattr(value, one.name) for one in dataclasses.fields(value)}
            elif field.name == "leaks":
                value = {
                    f"{leak.way} {one.name}": getattr(leak, one.name)
                    for leak in value
                    for one in dataclasses.fields(leak)
                    if one.name not in ("way", "causes")
                }
            parts = value if isinstance(value, dict) else {"": value}
            for part, content in parts.items():
                if content is not None:
                    flat = np.ravel(np.asarray(content, dtype=float)).tolist()
                    values[f"{step.step} {field.name} {part}".strip()] = flat
    return values


def computed(checkout, only):
    """Print the numbers of the scenes, made by the packages of a checkout."""
    import tempfile

    from patchlaw import Scene, run

    def of_scene(sections):
        history = run(Scene.from_dict(sections))
        return {"numbers": numbers(history), "notes": list(map(str, history.notes))}

    def problems(folder):
        plain = dict(own_problems(checkout))
        for name, sections in scenes(folder):
            yield name, partial(of_scene, sections)
            if name in ON_RANKS:
                plain[f"{name}, 2 ranks"] = partial(by_command, sections, folder, ranks=2)
            if name in RESUMED:
                longer = sections | {"load": sections["load"] | {"steps": 6}}
                plain[f"{name}, resumed"] = partial(by_command, longer, folder, killed=True)
        for name, solve in plain.items():
            yield name, lambda solve=solve: {"numbers": solve(), "notes": []}

    with tempfile.TemporaryDirectory() as folder:
        write_meshes(folder)
        for name, solve in problems(folder):
            if only and only not in name:
                continue
            began = time.perf_counter()
            try:
                result = solve()
            except Exception as error:
                result = {"error": f"{type(error).__name__}: {error}"}
            result["seconds"] = time.perf_counter() - began
            print(json.dumps([name, result]), flush=True)


def store(path, checkout, only=""):
    """Write the numbers of the scenes to a file."""
    checkout = Path(checkout).resolve()
    environment = os.environ | {"PATCHLAW_CACHE": "off", "PYTHONPATH": str(checkout)}
    words = [checkout / ".venv" / "bin" / "python", Path(__file__).resolve(), "run", checkout, only]
    found = {}
    with subprocess.Popen(
        list(map(str, words)), env=environment, stdout=subprocess.PIPE, text=True, cwd=checkout
    ) as process:
        for line in process.stdout:
            if not line.startswith('["'):
                continue
            name, result = json.loads(line)
            found[name] = result
            told = result.get("error", f"{len(result.get('numbers', ()))} numbers")
            print(f"{name:28} {result['seconds']:6.1f} s  {told}", flush=True)
    Path(path).write_text(json.dumps(found))


def _beside(key):
    """Return what moments and tilts are compared with too, on 1 mm: both may be about zero."""
    table = re.sub(r"moment(_[xy])?_N_mm$", "force_N", key)
    return re.sub(r"tilt(_[xy])?$", "approach_mm", table)


def compare(before, after):
    """Print the largest relative difference of every scene, and where it is."""
    before, after = (json.loads(Path(path).read_text()) for path in (before, after))
    worst = 0.0
    for name, was in before.items():
        now = after.get(name)
        if now is None:
            continue
        if "error" in was or "error" in now:
            print(f"{name:28} {was.get('error')} | {now.get('error')}")
            worst = max(worst, float(was.get("error") != now.get("error")))
            continue
        largest, place = 0.0, ""
        for key in was["numbers"].keys() | now["numbers"].keys():
            a, b = was["numbers"].get(key), now["numbers"].get(key)
            if a is None or b is None or len(a) != len(b):
                largest, place = float("inf"), key
                continue
            scale = max(map(abs, a + was["numbers"].get(_beside(key), []))) if a else 1.0
            scale = scale or 1.0
            if "imbalance" in key:  # which is relative itself
                scale = 1.0
            apart = max((abs(x - y) / scale for x, y in zip(a, b, strict=True)), default=0.0)
            if apart > largest:
                largest, place = apart, key
        worst = max(worst, largest)
        same = "" if was["notes"] == now["notes"] else "  notes differ"
        print(f"{name:28} {largest:8.1e}  {place}{same}")
    print(f"{len(before)} scenes; largest difference {worst:.1e}")


if __name__ == "__main__":
    command, *words = sys.argv[1:]
    if command == "run":
        computed(Path(words[0]), words[1])
    elif command == "store":
        store(*words)
    else:
        compare(*words)
