# %% [markdown]
# # Fretting: a sphere that is sheared to and fro wears outside its stick zone
#
# What one learns: under a shear force below the friction the rim of a contact slips and wears; its
# middle sticks. The worn ring unloads itself: in the end nothing presses where cells slip, the
# stick zone, as large as in the first cycle, bears the whole load, and wear ends.
#
#     sphere ──▶ press, shear to ±Q, again and again ──▶ worn ring, pressures, volume
#
# Tractions q and pressures p of two like bodies obey |q| ≤ μ p; the depth k ∫ p |ds| wears off by
# slips s. Stick radius: Cattaneo (1938), Mindlin (1949), c = a (1 − Q/μF)^⅓. It stays, and the
# pressure in the end is that of a worn sphere which touches within c alone (Ciavarella & Hills
# 1999, Eur. J. Mech. A 18, 491-497):
#
#     p = 2 E*/(π R) √(c² − r²) + Q/(2π μ c)/√(c² − r²)
#
# Run time: 15 s. `--quick` for fewer cells and cycles, `--out DIR` for the picture.

# %%
import argparse
from pathlib import Path

import numpy as np

from patchlaw import Material, Problem, Step, Surface
from patchlaw.geometry import MaterialPair, ShearControl
from patchlaw.multiscale import CellContact
from patchlaw.multiscale.results.figures import style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/fretting"))
choice = parser.parse_args()
CELLS, CYCLES = (32, 8) if choice.quick else (96, 15)
RADIUS, FORCE, FRICTION = 10.0, 60.0, 0.6  # mm, N, 1
SHEAR = 0.75 * FRICTION * FORCE  # N, on both sides
WEAR = 2e-3  # mm²/N: a cycle stands for 20 000 to 200 000 of the 1e-8 to 1e-7 mm²/N of steel
STEEL = Material(young_modulus=210e3, poisson_ratio=0.0)  # for which the closed forms are exact

# %% [markdown]
# Hertz's contact of a ball on a flat, both of steel, and its stick zone.

# %%
pair = MaterialPair(first=STEEL, second=STEEL)
modulus = pair.contact_modulus
edge = (0.75 * FORCE * RADIUS / modulus) ** (1 / 3)
stick = edge * (1.0 - SHEAR / (FRICTION * FORCE)) ** (1 / 3)
side = 2.7 * edge
x = ((np.arange(CELLS) + 0.5) / CELLS - 0.5) * side
far = np.hypot(x[:, None], x)
ball = Surface(heights=-(far**2) / (2.0 * RADIUS), lengths=(side, side))
contact = CellContact.of(
    ball, STEEL, counter=STEEL, friction=FRICTION, wear=WEAR, finite_slopes=False
)
turns = [SHEAR if number % 2 == 0 else -SHEAR for number in range(2 * CYCLES)]
loads = [Step(force=FORCE, shear=ShearControl(force=(one, 0.0))) for one in (0.0, *turns)]
pressures, depths, steps, stuck = [], [], [], []
for step in Problem(contact, loads).steps():
    state = contact.latest
    steps.append(step)
    pressures.append(state.pressure)
    depths.append(state.worn_depth if state.worn_depth is not None else np.zeros_like(far))
    stuck.append(np.sqrt(state.shear.sticking.sum() / np.pi) * side / CELLS)
    if step.step % 8 == 0 or step.step == 2:
        print(
            f"{step.step / 2:4.0f} cycles: sticks within {1e3 * stuck[-1]:.1f} µm, "
            f"{step.peak_pressure_MPa:.0f} MPa at most, {1e3 * step.worn_depth_mm:.2f} µm, "
            f"{1e9 * step.worn_volume_mm3:.0f} µm³ worn off",
            flush=True,
        )

# %% [markdown]
# In the end the sphere lies on a cap of radius c; what would overlap around it has worn off.

# %%
beyond, within = np.maximum(far, stick), np.sqrt(np.maximum(stick**2 - far**2, 1e-12))
punch = SHEAR / FRICTION  # N, what a flat punch of radius c would bear of the load
final = 2.0 * modulus / (np.pi * RADIUS) * within + punch / (2.0 * np.pi * stick) / within
punch /= 2.0 * modulus * stick  # mm, and what it would approach by
angle = np.arcsin(stick / beyond)
around = (2.0 * stick**2 - far**2) * angle + stick * np.sqrt(beyond**2 - stick**2)
around = around / (np.pi * RADIUS) + 2.0 / np.pi * punch * angle
overlap = stick**2 / RADIUS + punch - far**2 / (2.0 * RADIUS) - around
worn = np.where(far > stick, np.maximum(overlap, 0.0), 0.0)

volume = np.array([step.worn_volume_mm3 for step in steps])
lost = np.array([step.dissipated_mJ for step in steps])
np.testing.assert_allclose(volume, WEAR / FRICTION * lost, rtol=1e-9)
assert volume[-1] - volume[-3] < (2e-2 if choice.quick else 1e-4) * volume[-1]
np.testing.assert_allclose(np.array(stuck[1:]), stick, rtol=0.02)  # its area is one of cells
inside, outside = far < 0.7 * stick, far > 1.2 * stick
np.testing.assert_allclose(pressures[-1][inside], final[inside], rtol=0.01)
assert pressures[-1][outside].max() < 1e-4 * pressures[0].max()
np.testing.assert_allclose(depths[-1][outside], worn[outside], atol=0.03 * worn.max())
print(
    f"stick radius {1e3 * stuck[1]:.1f} µm (Cattaneo and Mindlin {1e3 * stick:.1f} µm), contact "
    f"{1e3 * edge:.1f} µm; in the middle {pressures[-1].min(where=inside, initial=np.inf):.0f} MPa "
    f"({final[inside].min():.0f} MPa) instead of {pressures[0].max():.0f} MPa"
)

# %%
style.use_style()
figure = style.new_figure(5.2, 2.5)
left, right = figure.subplots(1, 2, width_ratios=(1.35, 1.0))
row, half = CELLS // 2, slice(CELLS // 2, None)
place = 1e3 * x[half]
for one, name in ((0, "new"), (2, "1 cycle"), (len(steps) - 1, f"{CYCLES} cycles")):
    left.plot(place, pressures[one][half, row], label=name)
shown = place < 0.98e3 * stick
left.plot(place[shown], final[half, row][shown], "k:", lw=1.2, label="closed form")
left.set(xlabel="radius [µm], along the shear", ylabel="pressure [MPa]", ylim=(0.0, 3.4e3))
left.legend(handlelength=0.9, borderaxespad=0.0)
left.set_title("peaks are cut off")
shown = np.ma.masked_less_equal(1e3 * depths[-1], 0.0)
drawn = style.draw_image(right, ball.lengths, shown, largest=True, cmap=style.PRESSURES, vmin=0.0)
style.colour_bar(drawn, right, "worn depth [µm]")
circle = np.linspace(0.0, 2.0 * np.pi, 200)
middle, radius = 5e2 * side, 1e3 * stick
right.plot(middle + radius * np.cos(circle), middle + radius * np.sin(circle), "k--", lw=1.0)
right.set_title("dashed: stick zone")
choice.out.mkdir(parents=True, exist_ok=True)
figure.savefig(choice.out / "fretting.png")
