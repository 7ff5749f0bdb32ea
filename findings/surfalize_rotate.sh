#!/usr/bin/env bash
# surfalize: a map turned by an angle, with points that lie further apart along x than along y.
#
# Guess: a plane that is turned is as steep as before.
# Seen: it is turned as if points were square and then stretched: of a plane of slopes 0.1 and 0.2, which is 0.224 steep, 45
# degrees make one of 0.179, for steps of 1 and 0.5 µm. Square points and quarter turns are right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2
python - <<'END'
import numpy as np
from surfalize import Surface

n, slopes = 64, (0.1, 0.2)
for step_x, step_y, angle, seen in ((1.0, 1.0, 45, 0.2236), (1.0, 0.5, 90, 0.2236), (1.0, 0.5, 45, 0.1789)):
    y, x = np.meshgrid(step_y * np.arange(n), step_x * np.arange(n), indexing="ij")
    plane = Surface(slopes[0] * x + slopes[1] * y, step_x, step_y)
    turned = plane.rotate(angle)
    along_y, along_x = np.gradient(turned.data, turned.step_y, turned.step_x)
    steep = np.hypot(along_x, along_y)[5:-5, 5:-5].mean()
    print(f"steps {step_x}, {step_y}, by {angle} degrees: gradient {np.hypot(*slopes):.4f} becomes {steep:.4f}")
    assert abs(steep - seen) < 1e-3
END
