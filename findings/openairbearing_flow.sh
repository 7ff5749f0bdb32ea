#!/usr/bin/env bash
# openairbearing: flow through porous air bearings and seals, in L/min, as Result.qs, qa and qc are described.
#
# Guess: where the gap is so wide that all pressure is lost in the porous wall, the flow is that of the free wall, Qsc, which the wall's
# permeability was taken from, also in L/min; what a load and a flow are summed over is the area of the bearing.
# Seen: 1.293 times as much, 3.61 of 2.8 L/min: the flow has the density of air in it, which the permeability has not. On rectangles distances
# of points are the side by n + 1, where n points have n - 1 steps: the area that pressures are summed over is 0.929 of the bearing's on the
# default grid of 40 x 20 points, so is every load. No warning. Divide flows by rho; take circles and strips for loads.
set -euo pipefail
source "$(dirname "$0")/packages.sh" openairbearing==0.1.8 scipy==1.17.1
python - <<'END'
import numpy as np
from openairbearing.bearings import AnnularBearing, CircularBearing, RectangularBearing
from openairbearing.solvers import solve_bearing
from openairbearing.utils import get_load_capacity

for kind in (CircularBearing, AnnularBearing):
    bearing = kind(ha_min=400e-6, ha_max=500e-6, nh=2, nx=2000)
    bearing.ps = bearing.psc
    for solution in ("analytic", "numeric"):
        flow = solve_bearing(bearing, solution).qs[-1]
        print(f"{kind.__name__}, {solution}: {flow:.4f} L/min of {bearing.Qsc} through the free wall, {flow / bearing.Qsc:.4f}")
        assert abs(flow / bearing.Qsc / bearing.rho - 1) < 0.01
bearing = RectangularBearing(nh=2)
pressure = np.full((bearing.ny, bearing.nx, 2), bearing.pa + 1e5)
load = get_load_capacity(bearing, pressure)[0]
print(f"rectangle: an even pressure of 1e5 Pa on {bearing.xa * bearing.ya:g} m^2 bears {load:.2f} N")
assert abs(load / (1e5 * bearing.xa * bearing.ya) - 40 / 41 * 20 / 21) < 1e-9
END
