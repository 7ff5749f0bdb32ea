#!/usr/bin/env bash
# Kratos, PenaltyContactFrictionless: its penalty (advance_ALM_parameters, manual_ALM).
#
# Guess: a pressure per overclosure, so that a linear contact law keeps its force on any mesh, as mortar forms should.
# Seen: it is multiplied by gaps that are weighted by the nodes' areas: a cube under a plate bears 2.78, 1.19, 0.36 N on
# 1, 2, 4 cells an edge where pressures would give 4.17 N on each, and AUGMENTED_NORMAL_CONTACT_PRESSURE of a uniform
# pressure is 4 times as large in the middle as at corners. A finer mesh is softer. Take it as a penalty alone.
set -euo pipefail
source "$(dirname "$0")/packages.sh" KratosContactStructuralMechanicsApplication==10.4.4
python - <<'END' | grep -a 'an edge'
import json

import KratosMultiphysics as Kratos
import KratosMultiphysics.ContactStructuralMechanicsApplication as Contact
from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import StructuralMechanicsAnalysis

Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)


def write_mesh(cells):
    edge, ring = cells + 1, ((0, 0), (1, 0), (1, 1), (0, 1))
    number = lambda i, j, k: 1 + i + edge * (j + edge * k)
    nodes = [(i / cells, j / cells, k / cells - 1) for k in range(edge) for j in range(edge) for i in range(edge)]
    count = len(nodes)
    nodes += [(1.5 * a - 0.25, 1.5 * b - 0.25, c) for c in (0, 0.25) for a, b in ring]
    below = [(i, j, k) for k in range(cells) for j in range(cells) for i in range(cells)]
    bricks = [[number(i + a, j + b, k + c) for c in (0, 1) for a, b in ring] for i, j, k in below]
    faces = [[number(i + a, j + b, cells) for a, b in ring] for j in range(cells) for i in range(cells)]
    plate, top = range(count + 1, count + 9), sorted({node for face in faces for node in face})
    write = lambda rows: [" ".join(map(str, row)) for row in rows]
    block = lambda name, rows: [f"Begin {name}", *rows, f"End {name.split()[0]}"]
    lines = block("Nodes", write((n + 1, *node) for n, node in enumerate(nodes)))
    elements = [(n + 1, 1, *brick) for n, brick in enumerate(bricks)] + [(len(bricks) + 1, 2, *plate)]
    lines += [*block("Properties 1", []), *block("Properties 2", [])]
    lines += block("Elements SmallDisplacementElement3D8N", write(elements))
    conditions = [(n + 1, 1, *face) for n, face in enumerate(faces)]
    conditions += [(len(faces) + 1, 2, *(count + n for n in (1, 4, 3, 2)))]
    lines += block("Conditions SurfaceCondition3D4N", write(conditions))
    parts = {"cube": (range(1, count + 1), range(1, len(bricks) + 1), ()), "plate": (plate, (len(bricks) + 1,), ())}
    parts |= {"base": (range(1, edge**2 + 1), (), ()), "slave": (top, (), range(1, len(faces) + 1))}
    parts["master"] = (plate[:4], (), (len(faces) + 1,))
    for name, members in parts.items():
        kinds = zip(("Nodes", "Elements", "Conditions"), members)
        inner = [line for kind, some in kinds for line in block(f"SubModelPart{kind}", map(str, some))]
        lines += block(f"SubModelPart {name}", inner)
    open("cube.mdpa", "w").write("\n".join([*lines, ""]))


def held(part, along, value):
    parameters = {"model_part_name": f"Structure.{part}", "variable_name": "DISPLACEMENT", "interval": [0.0, "End"]}
    parameters |= {"constrained": along, "value": value}
    return {"python_module": "assign_vector_variable_process", "kratos_module": "KratosMultiphysics", "Parameters": parameters}


law = {"name": "LinearElastic3DLaw"}
elastic = {"constitutive_law": law, "Variables": {"YOUNG_MODULUS": 1000.0, "POISSON_RATIO": 0.0, "DENSITY": 1.0}, "Tables": {}}
parts = ("Structure.cube", "Structure.plate")
materials = [{"model_part_name": part, "properties_id": n + 1, "Material": elastic} for n, part in enumerate(parts)]
json.dump({"properties": materials}, open("materials.json", "w"))
contact = {"model_part_name": "Structure", "contact_model_part": {"0": ["slave", "master"]}}
contact |= {"assume_master_slave": {"0": ["slave"]}, "contact_type": "Frictionless"}
contact["advance_ALM_parameters"] = {"manual_ALM": True, "penalty": 5000.0, "scale_factor": 1.0}
solver = {"solver_type": "Static", "model_part_name": "Structure", "domain_size": 3, "analysis_type": "non_linear"}
solver["model_import_settings"] = {"input_type": "mdpa", "input_filename": "cube"}
solver["material_import_settings"] = {"materials_filename": "materials.json"}
solver |= {"time_stepping": {"time_step": 1.1}, "contact_settings": {"mortar_type": "PenaltyContactFrictionless"}}
solver |= {"residual_relative_tolerance": 1e-9, "residual_absolute_tolerance": 1e-9, "max_iteration": 30}
solver["convergence_criterion"] = "contact_residual_criterion"
process = {"python_module": "penalty_contact_process", "Parameters": contact}
process["kratos_module"] = "KratosMultiphysics.ContactStructuralMechanicsApplication"
walls = [held("cube", [True, True, False], [0.0, 0.0, None]), held("base", [True] * 3, [0.0] * 3)]
walls += [held("plate", [True] * 3, [0.0, 0.0, -0.005])]
project = {"problem_data": {"problem_name": "cube", "parallel_type": "OpenMP", "echo_level": 0, "start_time": 0.0, "end_time": 1.0}}
project |= {"solver_settings": solver, "processes": {"walls": walls, "contact": [process]}, "output_processes": {}}
for cells, seen in ((1, 2.777768), (2, 1.190476), (4, 0.362319)):
    write_mesh(cells)
    model = Kratos.Model()
    StructuralMechanicsAnalysis(model, Kratos.Parameters(json.dumps(project))).Run()
    force = sum(node.GetSolutionStepValue(Kratos.REACTION_Z) for node in model["Structure.base"].Nodes)
    pressures = [node.GetValue(Contact.AUGMENTED_NORMAL_CONTACT_PRESSURE) for node in model["Structure.slave"].Nodes]
    print(cells, "cells an edge:", force, "N, pressures", min(pressures), "to", max(pressures), "MPa", flush=True)
    assert abs(force - seen) < 1e-3 * seen
    assert cells < 4 or abs(min(pressures) / max(pressures) - 4) < 0.01
END
