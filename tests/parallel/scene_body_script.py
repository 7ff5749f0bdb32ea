"""Forces of scenes on bodies from meshes, printed by rank 0; run under mpirun with a folder."""

import cmath
import sys
from pathlib import Path

from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.bodies import face_terms

face_terms._modes = lambda *of: 4  # of bodies under contacts; with 8 these took most of the time

SURFACE = {
    "spectrum": {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.2, "seed": 3},
    "grid": [16, 16],
}
CONSTANTS = {"young_modulus": "4 GPa", "poisson_ratio": 0.15}
ON_RANKS = {
    "patches": (2, 3), "points": (2,), "rough": (3,), "sample": (3,), "friction": (3,),
    "leak": (2,), "stages": (2,), "pair": (3,), "errors": (3,), "curved": (2,),
    "contacts": (2,), "worn": (3,),
}  # fmt: skip
"""Numbers of ranks besides one; laws on a mesh on both, what goes with them on one of them."""
QUIET = {"figures": False, "report": False, "check": "none", "contact": "none"}


def sections(folder):
    """Yield the sections of scenes by name."""
    body = {"mesh": f"{folder}/cube.msh", "contact": "top", "supports": [{"surface": "bottom"}]}
    above = {"mesh": f"{folder}/above.msh", "contact": "bottom", "supports": [{"surface": "top"}]}
    body, above = body | CONSTANTS, above | CONSTANTS
    whole = {"surface": {**SURFACE, "lengths": [1, 1]}, "patches": {"grid": [2, 2]}}
    whole |= {"micro": {"finite_slopes": False}, "body": body, "output": QUIET}
    whole |= {"load": {"approach": "6 um", "steps": 2, "tilt": [1e-3, 0]}}
    for name, way in (("patches", {}), ("points", {"interface": "pointwise"})):
        coupling = {"kind": "consistent", "table_tolerance": 5e-2, **way}
        yield name, {**whole, "coupling": coupling}
    rough = {"coupling": {"kind": "reference"}, "reference": {"fine": 0.1, "meshes": 1}}
    yield "rough", {**whole, **rough}
    sample = {"surface": {**SURFACE, "lengths": [0.1, 0.1]}, "law": {"kind": "representative"}}
    sample["coupling"] = {"table_tolerance": 5e-2}
    load = {"load": {"force": "2 N", "steps": 1, "tilt": "free"}}
    yield "sample", {**sample, **load, "body": body, "output": QUIET}
    shear = {"shear": [["0.3 um", "0.1 um"]], "shear_steps": 1}
    rubbed = {"load": load["load"] | shear, "friction": {"coefficient": 0.3}}
    measured = QUIET | {"check": "last"}
    few = {**body, "mesh": f"{folder}/small 0.msh"}  # whose errors take many load steps
    yield "friction", {**sample, **rubbed, "body": few, "output": measured}
    worn = {"wear": {"coefficient": "1e-9 mm^2/N"}, "load": load["load"] | {"sliding": "10 m"}}
    yield "worn", {**sample, **worn, "body": few, "output": measured}
    leak = {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"]}
    edges = {"inlet": "left", "outlet": "right"}
    yield "leak", {**sample, **load, "body": body, "leak": leak | edges, "output": QUIET}
    stages = [
        {
            "force": "12 N",
            "steps": 2,
            "body": {"pretension": [{"surface": "right", "pull": "6 N"}]},
        },
        {"force": "10 N", "steps": 1, "body": {"tractions": [{"surface": "back", "pressure": 3}]}},
        {"hold": "approach", "steps": 2, "body": {"temperature": "20 K"}},
    ]
    warm = {**body, "thermal_expansion": "20 ppm/K"}
    parts = {"load": {"stage": stages, "tilt": "free"}}
    yield "stages", {**sample, **parts, "body": warm, "output": QUIET}
    above["element"] = "quadratic"
    yield "pair", {**sample, **load, "body": body, "counter_body": above, "output": measured}
    sample["law"] = sample["law"] | {"seeds": [1, 2]}
    load["load"] = {"approach": "6 um", "steps": 1, "tilt": [1e-3, 0]}
    yield "errors", {**sample, **load, "body": body, "output": measured}
    curved = {**body, "mesh": f"{folder}/curved.msh", "element": "quadratic"}
    yield "curved", {**sample, **load, "body": curved, "output": measured}
    small, other = (
        {**one, "mesh": f"{folder}/small {n}.msh"} for n, one in enumerate((body, above))
    )
    both = {"body": small, "counter_body": other | {"element": "linear"}}
    both |= {"coupling": {"kind": "concurrent"}, "friction": {"coefficient": 0.3}}
    for key in ("surface", "counter_surface"):
        both[key] = {**SURFACE, "lengths": [1, 1]}
    yield "contacts", {**both, "load": rubbed["load"], "output": measured}


def main(folder):
    """Run all scenes and print their last forces and approaches."""
    comm, found = MPI.COMM_WORLD, {}
    for name, content in sections(folder):
        if comm.size > 1 and comm.size not in ON_RANKS[name]:
            continue
        run = Run(Scene.from_dict(content), comm)
        list(run.load_steps())
        last = run.steps[-1]
        # errors are differences of forces
        errors = [last.force_N + error for _, error in last.errors]
        found[name] = (
            last.force_N, last.approach_mm, getattr(last.leak("face"), "rate", 0.0), *errors,
        )  # fmt: skip
        if last.shear_force_x_N is not None:
            shear = complex(last.shear_force_x_N, last.shear_force_y_N)
            # a component that is almost zero has no more digits than the other
            found[name] += abs(shear), cmath.phase(shear), last.dissipated_mJ
            found[name] += tuple(abs(shear) + error for _, error in last.shear_errors)
        run.close()
    tell(found)


main(Path(sys.argv[1]))
