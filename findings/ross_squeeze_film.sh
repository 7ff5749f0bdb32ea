#!/usr/bin/env bash
# ROSS, of rotordynamics: squeeze film dampers (SqueezeFilmDamper), whose film may cavitate.
#
# Guess: damping, stiffness and the largest pressure are those of Reynolds' equation for short films, by a groove in the middle those of two films of
# half the length; a film that does not cavitate has twice the damping of one that does.
# Seen: without a groove so it is. With one, the default, a film that cavitates is right but for its largest pressure, which is twice as large as it is;
# of one that does not the groove is forgotten: 4 times the damping, 8 times that of the cavitating one. With seals (long films) the stiffness of
# the cavitating film is 0, as if it were full, where damping and frequency make 2/pi/sqrt(1 - e^2) e times as much. No warning.
set -euo pipefail
source "$(dirname "$0")/packages.sh" ross-rotordynamics==2.3.0 plotly==5.24.1 scipy==1.16.3
python - 2>log <<'END' || { cat log; exit 1; }
import numpy as np
import ross
from scipy.integrate import quad

RADIUS, CLEARANCE, RATIO, SPEED, VISCOSITY = 0.06, 1e-4, 0.3, 1000.0, 0.04  # a circular orbit


def film(length, full):
    """Return damping, stiffness and the largest pressure of a short film, integrated along it by hand and around it by quadrature."""
    squeeze = VISCOSITY * RATIO * SPEED / CLEARANCE**2

    def pressure(angle):
        return -np.sin(angle) / (1 + RATIO * np.cos(angle)) ** 3

    bounds = (0 if full else np.pi, 2 * np.pi)
    tangential, radial = (
        quad(lambda angle: pressure(angle) * part(angle), *bounds)[0] * squeeze * length**3 * RADIUS for part in (np.sin, np.cos)
    )
    offset = CLEARANCE * RATIO
    return -tangential / offset / SPEED, -radial / offset, 1.5 * squeeze * length**2 * pressure(np.linspace(np.pi, 2 * np.pi, 20001)).max()


for geometry, cavitates, seen in (
    ("groove-end_seals", True, (1, 1, 1)),
    ("groove-end_seals", False, (1, None, 1)),
    ("groove", True, (1, 1, 2)),
    ("groove", False, (4, None, 2)),
):
    damper = ross.SqueezeFilmDamper(
        0, [SPEED], 0.03, RADIUS, CLEARANCE, RATIO, "TEST", geometry=geometry, cavitation=cavitates
    )
    films = 2 if geometry == "groove" else 1
    damping, stiffness, pressure = film(0.03 / films, not cavitates)
    shares = [damper.cxx[0] / damping / films, damper.kxx[0] / stiffness / films if cavitates else None, damper.p_max[0] / pressure]
    print(f"{geometry}, {'cavitates' if cavitates else 'full'}: damping, stiffness, pressure over Reynolds'", shares)
    for share, expected in zip(shares, seen):
        assert share is None or abs(share / expected - 1) < 1e-4
long = [
    ross.SqueezeFilmDamper(0, [SPEED], 0.3, RADIUS, CLEARANCE, RATIO, "TEST", geometry="end_seals", cavitation=one) for one in (True, False)
]
print("seals: damping", [one.cxx[0] for one in long], "stiffness", [one.kxx[0] for one in long])
assert abs(long[1].cxx[0] / long[0].cxx[0] - 2) < 1e-9 and long[0].kxx[0] == 0
END
