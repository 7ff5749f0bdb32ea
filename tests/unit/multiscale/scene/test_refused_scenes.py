"""Scenes that are refused: what differs from a scene that is none, the key, and the sentence."""

import copy
import math
import tomllib
from pathlib import Path

import pytest

from patchlaw.multiscale import Scene, make_setup, run
from patchlaw.support import InputError

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
STEEL = {"young_modulus": "210 GPa", "poisson_ratio": 0.3}
SURFACE = {
    "spectrum": {"hurst": 0.8, "waves": [2, 4], "rms_slope": 0.1},
    "grid": [16, 16],
    "lengths": ["1 mm", "1 mm"],
}
CELLS = {
    "surface": {
        "spectrum": {"hurst": 0.95, "waves": [2, 6], "rms_slope": 0.2, "seed": 1},
        "grid": [24, 24],
        "lengths": [1.0, 1.0],
    },
    "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
    "patches": {"grid": [2, 2]},
    "coupling": {"kind": "analytic"},
    "load": {"approach": 0.008, "steps": 1},
    "output": {"figures": False},
}
PART = {
    "surface": SURFACE,
    "body": {"mesh": "part.msh", "contact": "face", "supports": [{"surface": "back"}], **STEEL},
    "law": {"kind": "representative"},
    "load": {"approach": "1 um"},
}
LEAK = {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"]}
HEAT, WEAR = {"conductivity": ["50 W/m/K", "0.2 W/m/K"]}, {"coefficient": "2e-10 mm^2/N"}
SHEARED = {"load.approach": None, "load.force": "0.9 N", "load.shear": ["1 um", "0 um"]}
STAGES = [
    {"force": 0.9, "steps": 1}, {"shear": [0.0004, 0.0], "steps": 2},
    {"force": 0.5, "steps": 1, "name": "eased"},
    {"shear": [0.0004, 0.0001], "cycles": 1, "steps": 2},
]  # fmt: skip
NOT_PERIODIC = (
    "a body or a plane that turns does not continue periodically (allowed: coupling.kind = "
    "'analytic', micro.model = 'half-space', a level plane; or law.kind = 'representative')"
)
NOT_TURNED = (
    "leaves no counter-surface that continues periodically over these sides (allowed: "
    "multiples of 90 deg, of 180 deg on sides that differ)"
)
TURNS_BACK = (
    "does not go with a load that turns back where patch laws stand for the contact: they are "
    "those of rising loads and have no plastic depth (allowed: coupling.kind = 'concurrent')"
)
# of each base: sections and keys in place of its own (None leaves one out), the key that is
# named, and how the sentence begins
PAPER_REFUSED = [
    ({"block.young": 3},
     "block.young", "unknown key; did you mean 'young_modulus'? (allowed: height, lengths, yo"),
    ({"bloc": {"height": 3}},
     "bloc", "unknown key; did you mean 'block'? (allowed: accuracy, surface, counter_"),
    ({"surface.spectrum.hurt": 1},
     "surface.spectrum.hurt", "unknown key; did you mean 'hurst'? (allowed: hurst, waves, waves_x"),
    ({"surface.sede": 3},
     "surface.sede", "unknown key; did you mean 'surface.spectrum.seed'? (allowed: spectrum, f"),
    ({"surface.force": "3 N"},
     "surface.force", "unknown key; did you mean 'load.force'? (allowed: spectrum, file, height"),
    ({"load.Force": "3 N"},
     "load.Force", "unknown key; did you mean 'force'? (allowed: zero, approach, force, pres"),
    ({"block.young_modulus": "210 Gpa"},
     "block.young_modulus", "is in no usual unit; did you mean '210 GPa'? (allowed: a quantity in"),
    ({"block.young_modulus": "210 mPa"},
     "block.young_modulus", "is in no usual unit; did you mean '210 MPa'? (allowed: a quantity in"),
    ({"load.approach": "8 Mm"},
     "load.approach", "is in no usual unit; did you mean '8 mm'? (allowed: a quantity in units"),
    ({"load.approach": "8,5 um"},
     "load.approach", "cannot be read as a quantity; did you mean '8.5 um'? (allowed: a quantit"),
    ({"load.approach": "1,500 um"},
     "load.approach", "cannot be read as a quantity (allowed: a quantity in units of mm, such a"),
    ({"block.young_modulus": -4}, "block.young_modulus", "must be greater than 0"),
    ({"block.young_modulus": "4 kg"},
     "block.young_modulus", 'has the wrong unit (allowed: a quantity in units of MPa, such as "4'),
    ({"load.approach": "8 foo"},
     "load.approach", "cannot be read as a quantity (allowed: a quantity in units of mm, such a"),
    ({"load.approach": "8"},
     "load.approach", 'has no unit (allowed: a quantity in units of mm, such as "8 um")'),
    ({"load.approach": math.nan}, "load.approach", "is not finite (allowed: a finite quantity)"),
    ({"load.approach": 10**400}, "load.approach", "is not finite (allowed: a finite quantity)"),
    ({"": 3}, '""', "unknown key (allowed: accuracy, surface, counter_surface, block, body"),
    ({999 * "x": 3},
     999 * "x", "unknown key (allowed: accuracy, surface, counter_surface, block, body"),
    ({"load.approach": True},
     "load.approach", "is not a quantity (allowed: a number in mm or a string)"),
    ({"load.approach": -1}, "load.approach", "must be greater than 0"),
    ({"block.poisson_ratio": 0.5}, "block.poisson_ratio", "must be less than 0.5"),
    ({"block.poisson_ratio": -1}, "block.poisson_ratio", "must be greater than -1"),
    ({"load.steps": "x"}, "load.steps", "must be a valid integer"),
    ({"block.poisson_ratio": False}, "block.poisson_ratio", "must be a valid number"),
    ({"block.poisson_ratio": '"0.2"'}, "block.poisson_ratio", "must be a valid number"),
    ({"load.steps": 1.5}, "load.steps", "must be a valid integer"),
    ({"patches.grid": [0, 4]}, "patches.grid.0", "must be greater than or equal to 1"),
    ({"patches.grid": [4]}, "patches.grid", "has too few values"),
    ({"surface.grid": [64, 3]}, "surface.grid.1", "must be greater than or equal to 4"),
    ({"block": 3}, "block", "must be a section"),
    ({"coupling.kind": "magic"},
     "coupling.kind", "must be 'isolated', 'consistent', 'concurrent', 'analytic' or 'reference"),
    ({"load.approach": []},
     "load.approach", 'is an empty list (allowed: a quantity such as "8 um", or a list of turni'),
    ({"load.approach": ["8 um", -1]}, "load.approach", "must not turn below 0"),
    ({"load.approach": [0, "8 um"]}, "load.approach", "must be greater than 0"),
    ({"load.approach": [1, 1]},
     "load.approach", 'repeats a turning point (allowed: a quantity such as "8 um", or a list o'),
    ({"load.force": "8 um"},
     "load.force", 'has the wrong unit (allowed: a quantity in units of N, such as "5 N")'),
    ({"load.tilt": "fre"}, "load.tilt", "must be a list, or 'free'"),
    ({"load.tilt": [0.1]}, "load.tilt", "has too few values"),
    ({"load.tilt": ["1 kg", 0]},
     "load.tilt.0", 'has the wrong unit (allowed: a quantity in units of a ratio, such as "5'),
    ({"load.force_change": 0}, "load.force_change", "must be greater than or equal to 0.001"),
    ({"surface.spectrum.rms_height": 1},
     "surface.spectrum", "a spectrum needs exactly one amplitude, not rms_slope and rms_height (a"),
    ({"surface.spectrum.waves": [10, 2]},
     "surface.spectrum.waves", "is not a band (allowed: 0 ≤ lo ≤ hi, waves per side)"),
    ({"load.force": 1.0},
     "load", "needs exactly one load (allowed: 'approach', 'force', 'pressure' or 'stage')"),
    ({"surface.file": "a.npy"},
     "surface", "needs exactly one source (allowed: either 'spectrum' or 'file'; from Pyt"),
    ({"counter_body": {"mesh": "part.msh", "contact": "face",
     "supports": [{"surface": "back", "displacement": ["0", "free", "0.1 um"]}], **STEEL,
     "pretension": [{"surface": 1, "pull": "3 N"}]}},
     "counter_body.pretension", "bolts pull the body towards the counter-body, whose supports mov"),
    ({"load.stage": [{"approach": 1, "hold": "force"}]},
     "load.stage.0", "a stage states approach and hold of the plane (allowed: at most one of a"),
    ({"load.approach": None, "load.stage": [{"approach": 1, "body": {"temperature": "50 K"}}]},
     "load.stage.0.body", "loads a mesh, and there is no [body] of one (allowed: [body] with a me"),
    ({"load.approach": None, "load.stage": [{"approach": 1}], "load.cycles": 2},
     "load",
     "cycles = 2 needs two turning points (allowed: a list of loads, or cycles = 1; of a stage, "
     "its own cycles)"),
    ({"load.stage": [{"aproach": 1}]},
     "load.stage.0.aproach", "unknown key; did you mean 'approach'? (allowed: name, approach, for"),
    ({"body": {"mesh": "part.msh", "contact": "face", "poisson_ratio": 0.3}},
     "body", "needs the elastic constants of the body once (allowed: young_modulus and"),
    ({"counter_body": {"poisson_ratio": 0.3}},
     "counter_body", "needs the elastic constants of the body once (allowed: young_modulus and"),
    ({"counter_body": {**STEEL,
     "supports": [{"surface": "back", "displacement": ["0", "free", "0.1 um"]}]}},
     "counter_body",
     "'supports' needs a 'mesh' (allowed: a mesh; or young_modulus and poisson_ratio alone, of "
     "a half-space)"),
    ({"counter_body": STEEL, "coupling.kind": "reference"},
     "counter_body", "does not go with coupling.kind = 'reference', which meshes a body under"),
    ({"counter_body": STEEL},
     "counter_body",
     "is a half-space, which isolated laws do not know (allowed: a meshed block in its place, "
     "counter_body.mesh)"),
    ({"law": {"kind": "representative"}, "block.lengths": [9, 9], "counter_body": STEEL},
     "counter_body",
     "is a half-space, which laws of samples do not know (allowed: a meshed block in its place, "
     "counter_body.mesh)"),
    ({"counter_surface": {**SURFACE, "periodic": True}},
     "counter_surface.periodic", "is not surface.periodic (allowed: both, or neither)"),
    ({"block.lengths": [1, 1]},
     "block.lengths", "needs law.kind = 'representative' (allowed: leave it out; the sides of t"),
    ({"law": {"kind": "representative"}},
     "block.lengths", "is required with law.kind = 'representative', whose surface is a sample"),
    ({"coupling": None, "micro": None, "block.lengths": [9, 9], "law": {"kind": "representative",
     "regions": [{"surface": "ring", **SURFACE}]}},
     "law.regions", "names faces of a mesh (allowed: with [body])"),
    ({"law": {"samples": ["b.npy"]}},
     "law", "'samples' needs kind = 'representative' (allowed: leave it out)"),
    ({"friction": {"coefficient": 0.0}},
     "friction.coefficient", "must be greater than or equal to 0.000001"),
    ({"friction": {"coefficient": "rough"}}, "friction.coefficient", "must be a valid number"),
    ({"friction": {"coefficient": 0.3, "coupled": True}},
     "friction.coupled", "is true, but laws do not know how pressures of single contacts pull the"),
    (SHEARED,
     "load.shear", "needs friction (allowed: friction.coefficient, as in 0.3)"),
    ({"load.approach": None, "load.force": 1.0, "load.shear_force": [0.1, 0.0]},
     "load.shear_force", "needs friction (allowed: friction.coefficient, as in 0.3)"),
    ({"coupling.kind": "reference", "friction": {"coefficient": 0.3}},
     "friction", "does not go with coupling.kind = 'reference', which has no tangential tr"),
    ({"load.shear": ["1 um"]},
     "load.shear", 'is no pair of quantities along x and y (allowed: ["8 um", "8 um"], or a'),
    ({"load.shear": ["1 N", "0 N"]},
     "load.shear", 'has the wrong unit (allowed: a quantity in units of mm, such as "8 um")'),
    ({"load.shear": []},
     "load.shear", 'is no pair of quantities along x and y (allowed: ["8 um", "8 um"], or a'),
    ({"load.approach": None, "load.force": "0.9 N", "load.shear": [0.0, 0.0]},
     "load.shear", "repeats a point, or starts without shear (allowed: points that differ)"),
    (SHEARED | {"load.shear_force": [0.1, 0.0]},
     "load.shear_force", "is a second shear load (allowed: either 'shear' or 'shear_force')"),
    ({"load.approach": None, "load.force": 1.0, "load.shear_steps": 3},
     "load.shear_steps", "needs 'shear' or 'shear_force'"),
    (SHEARED | {"load.shear_cycles": 2},
     "load.shear_cycles", "needs two points of the shear (allowed: a list of pairs, or 1)"),
    (SHEARED | {"load.shear_path": "along", "load.shear_steps": 3},
     "load.shear_steps", "does not go with shear_path = 'along', which has the steps of the load"),
    ({"load.approach": None, "load.force": ["1 N", "2 N"], "load.shear": ["1 um", "0 um"],
     "load.shear_path": "along"},
     "load.shear", "has another number of points than the load that it goes along with (allo"),
    ({"load.approach": None, "load.stage": STAGES, "load.shear": ["1 um", "0 um"]},
     "load.shear", "does not go beside stages (allowed: 'shear' of a stage)"),
    ({"load.approach": None, "load.stage": STAGES},
     "load.stage", "needs friction (allowed: friction.coefficient, as in 0.3)"),
    ({"load.approach": None, "load.stage": [*STAGES, {"shear_force": [0.1, 0.0]}]},
     "load.stage", "state shifts and shear forces (allowed: either 'shear' or 'shear_force')"),
    ({"load.stage": [{"force": 1.0, "shear": [[0.001, 0.0], [0.0, 0.0]]}]},
     "load.stage.0.shear", "has several points (allowed: one pair; a stage for every other one)"),
    ({"load.approach": None, "load.force": 1.0, "load.shear_force": [0.24, 0.18],
     "friction": {"coefficient": 0.3}},
     "load.shear_force", "slides: friction transmits less than 0.3 N under 1 N (allowed: pairs sh"),
    ({"micro.hardness": 0}, "micro.hardness", "must be greater than 0"),
    ({"micro.hardness": "2 mm"},
     "micro.hardness", 'has the wrong unit (allowed: a quantity in units of MPa, such as "4 GPa"'),
    ({"micro.hardness": 300.0},
     "micro.hardness", "does not go with coupling.kind = 'isolated', which is elastic"),
    ({"coupling.kind": "reference", "micro.hardness": 300.0},
     "micro.hardness", "does not go with coupling.kind = 'reference', which is elastic"),
    ({"leak": {"pressures": [1.0, 2.0]}}, "leak.viscosity", "is required and missing"),
    ({"leak": {"viscosity": 1.0}}, "leak.pressures", "is required and missing"),
    ({"leak": {"viscosity": "0 Pa s"}}, "leak.viscosity", "must be greater than 0"),
    ({"leak": {"viscosity": "1 mm^2/s"}},
     "leak.viscosity", 'has the wrong unit (allowed: a quantity in units of Pa*s, such as "1 mPa'),
    ({"leak": {"viscosity": "1 MPa s"}},
     "leak.viscosity", "is in no usual unit; did you mean '1 mPa s'? (allowed: a quantity in uni"),
    ({"leak": {"viscosity": "1 mPa s", "pressures": ["1 bar"]}},
     "leak.pressures", "has too few values"),
    ({"leak": {"viscosity": "1 mPa s", "pressures": ["1 bar", "1 N"]}},
     "leak.pressures.1", 'has the wrong unit (allowed: a quantity in units of MPa, such as "4 GPa'),
    ({"leak": {"viscosity": "1 mPa s", "pressures": ["1 bar", "0.1 MPa"]}},
     "leak.pressures",
     'drives no flow (allowed: two different pressures such as ["2 bar", "1 bar"])'),
    ({"leak": LEAK | {"direction": "z"}},
     "leak.direction", "must be 'x', 'y' or 'both'"),
    ({"leak": {"density": 1.0}},
     "leak.density", "unknown key; did you mean 'block.density'? (allowed: viscosity, pressure"),
    ({"leak": LEAK},
     "leak", "does not go with coupling.kind = 'isolated', which knows no gaps of cell"),
    ({"coupling.kind": "reference", "leak": LEAK},
     "leak", "does not go with coupling.kind = 'reference', which knows no gaps of cel"),
    ({"conductance": {}},
     "conductance", "needs conductivities (allowed: conductivity = ['50 W/m/K', '0.2 W/m/K']"),
    ({"conductance": {"conductivity": ["0 W/m/K"]}},
     "conductance.conductivity", "must be greater than 0 (allowed: one or two quantities > 0 such"),
    ({"conductance": {"conductivity": ["50 W/m/K", "-1 W/m/K"]}},
     "conductance.conductivity", "must be greater than 0 (allowed: one or two quantities > 0 such"),
    ({"conductance": {"conductivity": ["50 W/m/K", "6e7 S/m"]}},
     "conductance.conductivity", "has the wrong unit (allowed: a quantity in units of W/m/K, such"),
    ({"conductance": {"resistivity": ["50 W/m/K"]}},
     "conductance.resistivity", "has the wrong unit (allowed: a quantity in units of ohm*m, such"),
    ({"conductance": {"conductivity": [1.0, 2.0, 3.0]}},
     "conductance.conductivity",
     'needs a value for one body or for both (allowed: one or two quantities > 0 such as "50 '
     'W/m/K")'),
    ({"conductance": {"resistivity": "1 ohm m", "gas": 0.026}},
     "conductance", "'gas' is about heat (allowed: with 'conductivity' beside it)"),
    ({"conductance": {"conductivity": 1.0, "temperature_jump": "1 um"}},
     "conductance", "'temperature_jump' is about the gas (allowed: with 'gas' beside it)"),
    ({"conductance": {"temperature_jump": "-1 um"}},
     "conductance.temperature_jump", "must be greater than or equal to 0"),
    ({"conductance": {"conductivity": 1.0, "temperature": 300.0}},
     "conductance", "radiation needs both 'temperature' and 'emissivity' (allowed: both, or n"),
    ({"conductance": {"emissivity": 1.2}},
     "conductance.emissivity", "must be less than or equal to 1"),
    ({"coupling.kind": "reference", "conductance": HEAT},
     "conductance", "does not go with coupling.kind = 'reference', whose meshes do not tell t"),
    ({"load.zero": "mean"},
     "load.zero",
     "is no height that approaches count from (allowed: 'first touch', 'mean plane', or "
     "'quantile 0.001' with any number between 0 and 1)"),
    ({"load.zero": 3}, "load.zero", "must be a valid string"),
    ({"friction": {"coefficient": 0.3}, "output": {"contact": "last"}},
     "output.contact", "the contact problem behind laws does not know what has slipped under the"),
    ({"surface.height_unit": "furlong"},
     "surface.height_unit", "is no unit of heights (allowed: m, cm, mm, um, nm, pm, Å, in)"),
    ({"surface.height_unit": "um"},
     "surface", "'height_unit' needs a 'file' (allowed: leave it out)"),
    ({"surface.periodic": True},
     "surface.periodic", NOT_PERIODIC),
    ({"counter_surface": {"rotation": "1 mm"}},
     "counter_surface.rotation", "has the wrong unit (allowed: a quantity in units of deg, such a"),
    ({"leak": LEAK, "patches.grid": [9, 2],
     "surface.grid": [32, 32], "coupling.kind": "concurrent"},
     "leak", "does not go with micro.model = 'circular', which knows no gaps beside su"),
    ({"load.approach": None},
     "load", "needs exactly one load (allowed: 'approach', 'force', 'pressure' or 'stage')"),
    ({"surface.lengths": None}, "surface", "a 'spectrum' needs 'grid' and 'lengths' beside it"),
    ({"surface": {}},
     "surface", "needs exactly one source (allowed: either 'spectrum' or 'file'; from Pyt"),
]  # fmt: skip
PAPER_REFUSED_AT_SETUP = [
    ({"surface.spectrum": None, "surface.file": "no/such/file.npy"},
     "surface.file", "there is no such file"),
    ({"surface.periodic": True, "micro.model": "half-space", "coupling.kind": "analytic",
     "load.approach": [0.02773190737263583, 0.001]},
     "load.approach",
     "leaves no gap on the periodic surface, whose mean displacement counts as none (allowed: "
     "less than 0.0277319 mm, where the plane reaches the mean height; beyond it load.force)"),
    ({"surface.spectrum.rms_slope": 10.0},
     "surface.spectrum",
     "the rms gradient of the heights is 10, no rough surface is so steep: the spectrum needs a "
     "smaller amplitude, or fewer waves (allowed: rms gradients up to 2)"),
]  # fmt: skip
CELLS_REFUSED = [
    ({"output.figures": "no"}, "output.figures", "must be a valid boolean, or 'all' or 'svg'"),
    ({"friction": {"coefficient": 0.3}},
     "friction", "has no effect without shear (allowed: load.shear, load.shear_force or lo"),
    ({"friction": {"coefficient": 0.3}, "micro": {"model": "elliptic"}},
     "friction", "does not go with micro.model = 'elliptic', which has no cells"),
    ({"micro": {"hardness": "2 GPa", "model": "elliptic"}},
     "micro.hardness",
     "does not go with micro.model = 'elliptic', which has no cells to yield (allowed: "
     "micro.model = 'half-space')"),
    ({"coupling.kind": "consistent", "load.approach": [0.008, 0.004], "micro": {"hardness": 300.0}},
     "micro.hardness", TURNS_BACK),
    ({"leak": LEAK,
     "micro": {"model": "elliptic"}},
     "leak", "does not go with micro.model = 'elliptic', which knows no gaps beside su"),
    ({"conductance": HEAT, "micro": {"model": "elliptic"}},
     "conductance", "does not go with micro.model = 'elliptic', which tells none without laws"),
    ({"coupling.kind": "consistent", "conductance": HEAT,
     "micro": {"hardness": "1 GPa"}},
     "conductance",
     "does not go with micro.hardness where patch laws stand for the contact: their stiffness "
     "is that of contacts that yield, which conduct all the same (allowed: coupling.kind = "
     "'concurrent')"),
    ({"surface.periodic": True, "coupling.kind": "consistent"},
     "surface.periodic", NOT_PERIODIC),
    ({"surface.periodic": True, "micro": {"model": "elliptic"}},
     "surface.periodic", NOT_PERIODIC),
    ({"surface.periodic": True, "load.tilt": "free"},
     "surface.periodic", NOT_PERIODIC),
    ({"accuracy": 0.5}, "accuracy", "must be less than 0.5"),
    ({"accuracy": "2 %"}, "accuracy", "must be a valid number"),
    ({"patches.grid": "many"}, "patches.grid", "must be a list"),
    ({"micro": {"model": "elliptic", "cells": [32, 32]}},
     "micro.cells", "does not go with micro.model = 'elliptic', which has no"),
    ({"coupling.kind": "reference", "micro": {"cells": [32, 32]}},
     "micro.cells", "does not go with coupling.kind = 'reference', which has no"),
    ({"law": {"kind": "representative"}, "block.lengths": [3.0, 2.0], "coupling": None,
      "patches": None, "micro": {"cells": [32, 32]}},
     "micro.cells", "does not go with law.kind = 'representative', which has no"),
    ({"accuracy": 0.05, "surface.grid": None, "micro": {"cells": [64, 64]}},
     "micro.cells", "needs surface.grid"),
    ({"load.approach": "1e-300 mm"},
     "load.approach", "is out of any scale (allowed: 1e-15 to 1e+15 mm)"),
    ({"load.approach": "1 m^9^9^9"},
     "load.approach", "cannot be read as a quantity (allowed: a quantity in units of mm, such a"),
    ({"load.approach": "9**9**9**9 um"},
     "load.approach", "cannot be read as a quantity (allowed: a quantity in units of mm, such a"),
    ({"block.young_modulus": 90 * "("},
     "block.young_modulus", "cannot be read as a quantity (allowed: a quantity in units of MPa, s"),
    ({"block.grading": 1e+30}, "block.grading", "must be less than or equal to 1000000"),
    ({"load.steps": 1000000000}, "load.steps", "must be less than or equal to 1000000"),
    ({"block.cells": [10000000000000000000000000000000000000000000, 1, 1]},
     "block.cells.0", "must be less than or equal to 1000000000"),
    ({"vibration": {}, "block.density": "1.2 g/cm^3"},
     "vibration", "does not go with coupling.kind = 'analytic', whose body has no mesh with a mas"),
    ({"vibration": {}, "block.density": "1.2 g/cm^3", "coupling.kind": "consistent",
      "counter_body": STEEL},
     "counter_body", "is a half-space, which has no mass that vibrates (allowed: counter_body.mes"),
    ({"wear": WEAR, "friction.coefficient": 0.3,
      "load.shear": [[1e-4, 0]], "load.sliding": "1 m"},
     "load.sliding", "does not go with a shear: faces that slide as wholes slip everywhere"),
    ({"wear": WEAR, "load.sliding": "1 m",
      "friction": {"coefficient": 0.3, "coupled": True}},
     "friction.coupled", "is true, but faces that slide as wholes do not know how tractions lift"),
    ({"friction": {"coefficient": 0.3, "speed": "1 m/s"}, "load.shear": [[1e-4, 0]]},
     "friction.speed", "has no effect where nothing slides (allowed: load.sliding beside it)"),
    ({"coupling.kind": "isolated", "wear": WEAR,
      "load.sliding": "1 m"},
     "wear", "does not go with coupling.kind = 'isolated', whose roughness does not run in"),
    ({"coupling.kind": "consistent", "wear": WEAR,
      "load.sliding": "1 m", "coupling.interface": "pointwise"},
     "wear", "does not go with coupling.interface = 'pointwise' under laws: they wear by patches"),
    ({"coupling.kind": "consistent", "wear": WEAR,
      "load.shear": [[1e-4, 0]], "friction.coefficient": 0.3},
     "wear", "does not go with a shear under laws: they do not tell how far single contacts slip"),
    ({"coupling.kind": None, "accuracy": 0.05, "wear": WEAR,
      "load.sliding": "1 m"},
     "wear", "does not go with accuracy under laws: it is kept of new faces alone (allowed: leave"
     " it out; or coupling.kind = 'concurrent')"),
    ({"coupling.kind": "consistent", "micro": {"hardness": 300.0},
      "load": {"stage": [{"pressure": "10 MPa"}, {"force": "8 N"}, {"force": "7 N"}]}},
     "micro.hardness", TURNS_BACK),
]  # fmt: skip
CELLS_REFUSED_AT_SETUP = [
    ({"coupling.kind": "consistent", "micro": {"hardness": 300.0}, "surface.lengths": [10.0, 10.0],
      "load": {"stage": [{"pressure": "10 MPa"}, {"force": "500 N"}]}},  # from 1000 N
     "micro.hardness", TURNS_BACK),
    ({"surface": {"heights": 8 * [8 * [0.0]], "lengths": [1.0, 1.0], "periodic": True}},
     "load.approach", "leaves no gap on the periodic surface, whose mean displacement counts as"),
    ({"load.zero": "quantile 1e-5"},
     "load.zero", "less than one of 576 heights is above this quantile (allowed: at least q"),
    ({"load.zero": "mean plane", "load.approach": "-50 um", "surface.spectrum.hurst": 0.9,
     "surface.spectrum.waves": [2, 5], "surface.spectrum.seed": 28},
     "load.approach", "does not touch the surface, or turns before first touch, 0.0291968 mm ab"),
    ({"load": {"stage": [{"force": 1.0}, {"pressure": "-2 MPa"}]}},
     "load.stage.1.pressure", "pulls the plane off the surface with 2 N (allowed: a force ≥ 0 N"),
    ({"load": {"stage": [{"approach": "2 um"}, {"approach": "-1 um"}]}},
     "load.stage.1.approach", "does not touch the surface, or turns before first touch, 0 mm"),
    ({"surface.spectrum.waves": None, "surface.spectrum.waves_x": [0, 1],
     "surface.spectrum.waves_y": [1, 1], "surface.spectrum.seed": 4, "surface.periodic": True,
     "surface.detrend": "plane"},
     "surface.detrend", "the map continues periodically along y, where its borders match; without"),
    ({"surface.spectrum.rms_slope": 1.71, "surface.spectrum.seed": 9, "surface.grid": [48, 48],
     "counter_surface": {"spectrum": {"hurst": 0.83, "waves": [2, 5], "rms_slope": 1.63, "seed": 4},
     "grid": [48, 48], "lengths": [1.0, 1.0]}},
     "counter_surface",
     "the rms gradient of the heights is 2.4, no rough surface is so steep: these are both "
     "sides together (allowed: rms gradients up to 2)"),
    ({"surface.spectrum.rms_slope": 0.93, "surface.grid": [48, 48]},
     "micro.finite_slopes",
     "finite slopes are known to second order, which fails at the rms gradient of the surface, "
     "0.93; without them (micro.finite_slopes = false) forces of such surfaces are too large by "
     "10 % and more, by an error that is not measured; coupling.kind = 'reference' meshes the "
     "slopes as they are (allowed: rms gradients up to 0.8)"),
    ({"surface.periodic": True,
     "counter_surface": {"spectrum": {"hurst": 0.9, "waves": [2, 5], "rms_slope": 0.1, "seed": 2},
     "grid": [20, 20], "lengths": [1.0, 1.0], "periodic": True, "rotation": "45 deg"}},
     "counter_surface.rotation", NOT_TURNED),
    ({"surface.periodic": True,
     "counter_surface": {"spectrum": {"hurst": 0.9, "waves": [2, 5], "rms_slope": 0.1, "seed": 2},
     "grid": [20, 20], "lengths": [1.0, 0.5], "periodic": True, "rotation": 90}},
     "counter_surface.rotation", NOT_TURNED),
    ({"micro": {"finite_slopes": True}, "surface.spectrum.rms_slope": 0.93},
     "micro.finite_slopes",
     "finite slopes are known to second order, which fails at the rms gradient of the surface, "
     "0.928; without them (micro.finite_slopes = false) forces of such surfaces are too large "
     "by 10 % and more, by an error that is not measured; coupling.kind = 'reference' meshes "
     "the slopes as they are (allowed: rms gradients up to 0.8)"),
    ({"counter_surface": {"heights": [5 * [0.0, 1e-3]] * 10, "lengths": [1.0, 1.0],
      "shift": ["0.1 mm", "0 mm"]}},
     "counter_surface.shift", "takes the counter-surface off the surface, which it must cover"),
    ({"load": {"force": "20 N"}, "micro": {"hardness": "20 MPa"}},
     "micro.hardness", "leaves no equilibrium: even where all of the face touches, the force of"),
    ({"coupling.kind": "concurrent", "load.approach": "1.1 mm"},
     "load.approach", "presses the body to nothing (allowed: at most the body's height, 1 mm)"),
    ({"load.tilt": [1, 0]},
     "load.tilt", "is too steep for the theory of small rotations (allowed: slopes within ±0.2)"),
    ({"load.tilt": [0, "-12 deg"]},
     "load.tilt", "is too steep for the theory of small rotations (allowed: slopes within ±0.2)"),
    ({"surface.grid": [1000000, 1000000]},
     "surface.grid", "needs about 1e+05 GB of memory"),
    ({"surface.spectrum.waves": [2, 1000000000.0]},
     "surface.spectrum", "a grid of 24 × 24 heights is too coarse for the shortest waves"),
    ({"patches.grid": [100000, 100000]},
     "patches.grid", "needs about 1e+03 GB of memory"),
    ({"coupling.kind": "isolated", "block.cells": [10000, 10000, 43],
     "micro": {"finite_slopes": False}},
     "block.cells", "needs about 1.38e+03 GB of memory"),
]  # fmt: skip
PART_REFUSED = [
    ({"coupling": {"love": "centre"}},
     "coupling", "love = 'centre' does not go with kind = 'consistent' (allowed: love = 'm"),
    ({"coupling": {"kind": "concurrent", "love": "centre"}},
     "coupling", "love = 'centre' does not go with kind = 'concurrent' (allowed: love = 'm"),
    ({"coupling": {"kind": "concurrent", "table_tolerance": 0.001}},
     "coupling",
     "table_tolerance = 0.001 does not go with kind = 'concurrent' (allowed: leave it out)"),
    ({"coupling": {"kind": "concurrent", "interface": "pointwise"}},
     "coupling",
     "interface = 'pointwise' does not go with kind = 'concurrent' (allowed: interface = "
     "'patchwise')"),
    ({"body.temperature": "50 K"},
     "body.temperature", "changes nothing, which does not expand (allowed: with thermal_expansion"),
    ({"body.temperature": {"oak": 9}},
     "body.temperature", "changes nothing in 'oak', which does not expand (allowed: with thermal_"),
    ({"body.temperature": "50 degC"},
     "body.temperature", "cannot be read as a quantity (allowed: a quantity in units of K, such a"),
    ({"body.young_modulus": None, "body.poisson_ratio": None,
     "body.materials": {"steel": {**STEEL, "thermal_expansion": "12 ppm/K"}},
     "body.thermal_expansion": 1e-05},
     "body.thermal_expansion", "is that of the whole body, which has materials by volume (allowed"),
    ({"body.tractions": [{"surface": 1}]},
     "body.tractions.0", "a loaded face needs exactly one load (allowed: either 'stress' or 'pres"),
    ({"body.pretension": [{"surface": 1, "pull": "-3 N"}]},
     "body.pretension.0.pull", "must be greater than or equal to 0"),
    ({"law": None, "body.pretension": [{"surface": 1, "pull": "3 N"}],
     "coupling": {"kind": "concurrent"}},
     "coupling.kind", "is 'concurrent', but loads of the body besides the contact need laws on"),
    ({"law": None,
     "body.supports": [{"surface": "back", "displacement": ["0", "free", "0.1 um"]}],
     "coupling": {"kind": "concurrent"}},
     "coupling.kind", "is 'concurrent', but loads of the body besides the contact need laws on"),
    ({"law": None, "body.pretension": [{"surface": 1, "pull": "3 N"}],
     "output": {"contact": "last"}},
     "output.contact", "the contact problem behind laws does not know of loads of the body (allo"),
    ({"load.approach": None, "load.stage": [{"approach": 1, "body": {"temperature": "50 K"}}]},
     "load.stage.0.body.temperature", "changes nothing, which does not expand (allowed: with ther"),
    ({"block": STEEL},
     "body", "is a second body below the surface (allowed: either [block] or [body])"),
    ({"body": None}, "block", "is required and missing (allowed: [block]; or [body], of a mesh)"),
    ({"body.cells": [4, 4, 4]},
     "body.cells", "unknown key; did you mean 'block.cells'? (allowed: mesh, contact, place,"),
    ({"body.supports": [{"surfac": "back"}]},
     "body.supports.0.surfac", "unknown key; did you mean 'surface'? (allowed: surface, displacem"),
    ({"body.materials": {"steel": {"young": "1 GPa"}}},
     "body.materials.steel.young", "unknown key; did you mean 'young_modulus'? (allowed: young_mo"),
    ({"body.contact": None}, "body.contact", "is required and missing"),
    ({"body.supports": None},
     "body", "a 'mesh' needs 'supports' beside it (allowed: names of its faces)"),
    ({"body.materials": {"a": STEEL}},
     "body", "needs the elastic constants of the body once (allowed: young_modulus and"),
    ({"body.contact": 1.5}, "body.contact", "must be a valid string"),
    ({"body.supports": [{"surface": 1, "displacement": ["0", "fre", "0"]}]},
     "body.supports.0.displacement.1", "cannot be read as a quantity, or 'free' (allowed: a quant"),
    ({"law": None, "body.tractions": [{"surface": 1, "stress": ["0", "0", "1 MPa"]}],
     "coupling": {"kind": "reference"}},
     "coupling.kind", "is 'reference', but loads of the body besides the contact need laws on i"),
    ({"coupling": {"kind": "consistent"}},
     "coupling.kind", "does not go with law.kind = 'representative', which stands at points (al"),
    ({"patches": {"grid": [2, 2]}},
     "patches.grid", "does not go with law.kind = 'representative', which has no patches (allo"),
    ({"body.place": [0, 0]},
     "body.place", "does not go with law.kind = 'representative', whose sample has no place"),
    ({"output": {"contact": "last"}},
     "output.contact", "does not go with law.kind = 'representative', which has no spots (allowe"),
    ({"surface.spectrum": None, "surface.file": "a.npy", "law.seeds": [1]},
     "law.seeds", "needs surface.spectrum (allowed: law.samples, which names further maps)"),
    ({"law.samples": ["b.npy"]},
     "law.samples", "needs surface.file (allowed: law.seeds for a spectrum)"),
    ({"law.axes": "polar"},
     "law.axes", "has no effect without a leak (allowed: [leak] beside it; or leave it out)"),
    ({"law.axes": "x", "law.centre": [0.0, 0.0, 0.0]},
     "law", "'centre' is that of polar axes (allowed: axes = 'polar' beside it)"),
    ({"law.axes": "around"}, "law.axes", "must be 'x' or 'polar'"),
    ({"law.seeds": [1, 1]}, "law", "seeds = [1, 1] has one twice (allowed: different seeds)"),
    ({"law.regions": [{"surface": "a", **SURFACE}, {"surface": "a", **SURFACE}]},
     "law", "regions name a face twice: ['a', 'a'] (allowed: each face once)"),
    ({"law.regions": [{"surface": "a", **SURFACE, "wear": "1e-8 mm^2/N"}]},
     "law.regions", "'wear' needs the section [wear] (allowed: [wear] with a coefficient)"),
    ({"law.regions": [{"surface": "a", **SURFACE, "friction": 0.3}]},
     "law.regions.0.friction", "needs [friction] (allowed: [friction] with a coefficient, which h"),
    ({"friction.coefficient": 0.4, "law.regions": [{"surface": "a", **SURFACE, "friction": 0}]},
     "law.regions.0.friction", "must be greater than or equal to 0.000"),
    ({"law.regions": [{"surface": "a", **SURFACE, "hardness": "soft"}]},
     "law.regions.0.hardness", "cannot be read as a quantity, or 'inf' (allowed: a quantity"),
    ({"law.regions": [{"surface": "a", **SURFACE, "hardness": "-2 GPa"}]},
     "law.regions.0.hardness", "must be greater than 0"),
    ({"load.approach": [1e-3, 5e-4], "law.regions": [
        {"surface": "a", **SURFACE}, {"surface": "b", **SURFACE, "hardness": "2 GPa"}]},
     "law.regions.1.hardness", TURNS_BACK),
    ({"conductance": {"conductivity": 50},
      "law.regions": [{"surface": "a", **SURFACE, "hardness": "2 GPa"}]},
     "conductance", "does not go with law.regions.0.hardness where patch laws stand for the"),
    ({"vibration": {}},
     "body.density", 'is required and missing beside [vibration] (allowed: "7850 kg/m^3")'),
    ({"vibration": {}, "body.young_modulus": None, "body.poisson_ratio": None,
      "body.materials": {"a": {**STEEL, "density": "7850 kg/m^3"}, "b": STEEL}},
     "body.materials.b.density", "is required and missing beside [vibration] (allowed:"),
    ({"vibration": {"sliding": [1, 0]}, "body.density": "7850 kg/m^3"},
     "vibration.sliding", "needs friction (allowed: friction.coefficient, as in 0.3)"),
    ({"vibration": {"sliding": [0, 0]}, "body.density": "7850 kg/m^3"},
     "vibration.sliding", "is no direction (allowed: [1, 0])"),
    ({"vibration": {"modes": 0}}, "vibration.modes", "must be greater than or equal to 1"),
    ({"vibration": {"plane": "2 N"}}, "vibration.plane", "has the wrong unit, or 'held' (allowed"),
    ({"vibration": {"plane": "2 kg"}, "body.density": 7.85e-9, "counter_body":
      {"mesh": "b.msh", "contact": 1, "supports": [{"surface": 2}], **STEEL, "density": 7.85e-9}},
     "vibration.plane", "is there no plane beside a counter-body (allowed: 'held')"),
    ({"body.density": 7850}, "body.density", "is out of any scale (allowed: 1e-15 to 1e-06 t/mm"),
    ({"counter_body": {**STEEL, "density": "1000 kg/m^3"}},
     "counter_body", "'density' needs a 'mesh' (allowed: a mesh; or young_modulus and poisson"),
]  # fmt: skip

BASES = {"paper": tomllib.loads(PAPER.read_text(encoding="utf-8")), "cells": CELLS, "part": PART}


def of_bases(**rows):
    """Parametrize a test by the rows of bases, numbered."""
    each = [
        pytest.param(base, *row, id=f"{base} {number}")
        for base, some in rows.items()
        for number, row in enumerate(some)
    ]
    return pytest.mark.parametrize(("base", "changes", "key", "sentence"), each)


def changed(base, changes):
    """Return a scene with other sections and keys."""
    data = copy.deepcopy(BASES[base])
    for path, value in changes.items():
        *sections, last = path.split(".")
        place = data
        for section in sections:
            place = place.setdefault(section, {})
        if value is None:
            del place[last]
        else:
            place[last] = value
    return data


def refused(what, scene):
    """Return the error of a refusal, and its sentence with the remedy."""
    with pytest.raises(InputError) as caught:
        what(scene)
    allowed = caught.value.allowed
    return caught.value, caught.value.problem + (f" (allowed: {allowed})" if allowed else "")


@of_bases(paper=PAPER_REFUSED, cells=CELLS_REFUSED, part=PART_REFUSED)
def test_reading_a_scene_refuses_it_by_key_and_sentence(base, changes, key, sentence):
    error, said = refused(Scene.from_dict, changed(base, changes))
    assert (error.key, said[: len(sentence)]) == (key, sentence)


@of_bases(paper=PAPER_REFUSED_AT_SETUP, cells=CELLS_REFUSED_AT_SETUP)
def test_what_is_read_is_refused_at_set_up(base, changes, key, sentence):
    """What only the surface, the mesh or the machine tells."""
    error, said = refused(make_setup, Scene.from_dict(changed(base, changes)))
    assert (error.key, said[: len(sentence)]) == (key, sentence)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"load.approach": 10**400}, f"load.approach = 1{198 * '0'}…: is not finite (allowed: "),
        ({999 * "x": 3}, f"{200 * 'x'}…: unknown key (allowed: accuracy, surface"),
    ],
    ids=["value", "key"],
)
def test_long_values_and_keys_are_shortened(changes, message):
    error, _ = refused(Scene.from_dict, changed("paper", changes))
    assert str(error).startswith(message)


@pytest.mark.parametrize("base", ["paper", "cells"])
def test_the_scenes_themselves_are_not_refused(base):
    assert make_setup(Scene.from_dict(BASES[base]))


def test_only_a_face_tells_whether_a_force_after_a_pressure_is_less():
    """8 N after 10 MPa on 0.5 mm², which are 5 N, is a load that rises."""
    stages = {"stage": [{"pressure": "10 MPa"}, {"force": "8 N"}], "steps": 1}
    data = {"coupling.kind": "consistent", "micro": {"hardness": 300.0}, "load": stages}
    scene = Scene.from_dict(changed("cells", data | {"surface.lengths": [1.0, 0.5]}))
    assert [step.value for step in make_setup(scene).parts.path] == [5.0, 8.0]
    assert [scene.loading.unloads_on(area) for area in (0.5, 0.9)] == [False, True]


def test_a_flat_periodic_surface_bears_forces():
    surface = {"heights": 8 * [8 * [0.0]], "lengths": [1.0, 0.7], "periodic": True}
    load = {"force": "5 N", "steps": 1}
    data = {"surface": surface, "load": load, "micro": {"finite_slopes": False}}
    (step,) = run(Scene.from_dict(changed("cells", data)))
    assert (step.contact_area_fraction, step.mean_separation_mm) == (1.0, 0.0)
    assert step.peak_pressure_MPa == pytest.approx(5.0 / 0.7, rel=1e-12)  # rounding
