#!/usr/bin/env bash
# OpenSees 3.7.1 (openseespy; 3.8.0 does the same), zeroLengthContact2D and zeroLengthContact3D: the friction of a node that slides.
#
# Guess: the reaction of the held node under it, and the force of the element, are pressure and friction; reactions balance the load.
# Seen: while it sticks, so they are. As it slides, friction stops the node as it should, by µ N, but is missing in the reaction
# and in the element's force (exactly 0), and the sum of reactions is short of the load by µ N. The pressure is right. Take friction as the
# load less the other reactions.
set -euo pipefail
source "$(dirname "$0")/packages.sh" openseespy==3.7.1.2 openseespylinux==3.7.1.2
python - <<'END' 2>log || { cat log; exit 1; }
import openseespy.opensees as ops

FRICTION, WEIGHT, SPRING = 0.3, 10.0, 100.0


def push(dim, load):
    """Press a node on a held one by WEIGHT, push it by load against a spring; return displacement and reactions along the push."""
    ops.wipe()
    ops.model("basic", "-ndm", dim, "-ndf", dim)
    for node in (1, 2, 3):
        ops.node(node, *[0.0] * dim)
    for node in (1, 3):
        ops.fix(node, *[1] * dim)
    ops.uniaxialMaterial("Elastic", 1, SPRING)
    ops.element("zeroLength", 2, 3, 2, "-mat", 1, "-dir", 1)
    if dim == 3:
        ops.fix(2, 0, 1, 0)
    end = (0.0, 3) if dim == 3 else ("-normal", 0, 1)
    ops.element(f"zeroLengthContact{dim}D", 1, 2, 1, 1e5, 5e4, FRICTION, *end)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(2, load, *[0.0] * (dim - 2), -WEIGHT)
    for name, *given in (("system", "BandGeneral"), ("numberer", "Plain"), ("constraints", "Plain")):
        getattr(ops, name)(*given)
    ops.test("NormUnbalance", 1e-10, 50, 0)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 0.1)
    ops.analysis("Static")
    assert ops.analyze(10) == 0
    force = ops.eleResponse(1, "force")[0]
    ops.reactions()
    assert abs(ops.nodeReaction(1)[-1] - WEIGHT) < 1e-8
    return ops.nodeDisp(2)[0], ops.nodeReaction(1)[0], ops.nodeReaction(3)[0], force


print("OpenSees", ops.version())
for dim in (2, 3):
    for load in (2.0, 5.0):
        shift, held, spring, force = push(dim, load)
        friction = load - SPRING * shift  # which the balance of the node asks for
        print(f"{dim}D, load {load}: friction {friction:.4f}, reaction {held:.4f}, element {force:.4f}, all reactions {held + spring:.4f}")
        if load < FRICTION * WEIGHT:
            assert abs(held + friction) < 1e-8 and abs(force - friction) < 1e-8 and abs(held + spring + load) < 1e-8
        else:
            assert abs(friction - FRICTION * WEIGHT) < 1e-8 and held == 0 and force == 0
            assert abs(held + spring + load - FRICTION * WEIGHT) < 1e-8
END
