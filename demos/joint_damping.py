# %% [markdown]
# # Stiffness and damping of a joint, from its roughness
#
# What one learns: the tangential stiffness of a joint is a fixed share of the normal one, whatever
# the pressure. Vibration costs energy, because the rims of all spots slip: with the third power of
# small amplitudes, as Mindlin found for a sphere, and faster from then on until all slides.
#
#        shear ──▶ ▁▂▃▂▁▂▄▃▂▁▃▅▃▂   spots stick in the middle and slip at their rims
#
# Two steel plates, clamped; Coulomb friction cell by cell (docs/theory.md, section 15).
#
# Run time: 40 s. `--quick` for a coarse grid, `--out DIR` for the figure.

# %%
import argparse
from pathlib import Path

import numpy as np

from patchlaw.geometry import Control, Material, MaterialPair, ShearControl, Spectrum, synthesise
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.multiscale.results.figures import style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/joint_damping"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
CELLS = 128 if choice.quick else 512
STEEL = Material(young_modulus=210e3, poisson_ratio=0.3)
FRICTION = 0.3
MINDLIN = 2.0 * (1.0 - STEEL.poisson_ratio) / (2.0 - STEEL.poisson_ratio)

# %%
spectrum = Spectrum(hurst=0.8, waves=(2, 4), rms_slope=0.05, seed=4)
surface = synthesise(spectrum, grid=(CELLS, CELLS), lengths=(1.0, 1.0))
pair = MaterialPair(first=STEEL, second=STEEL)
normal = HalfSpaceModel(surface=surface, contact_modulus=pair.contact_modulus)
sideways = FrictionModel(materials=pair, coefficient=FRICTION, spacing=surface.spacing)

# %% [markdown]
# Stiffness: a joint that sticks, under five clamping forces.

# %%
FORCES = (20.0, 50.0, 100.0, 200.0, 400.0)
ratios = []
print("force [N]  normal [N/µm]  tangential [N/µm]  ratio")
for force in FORCES:
    pressed = normal.press(Control(force=force))
    stuck = sideways.advance(None, pressed.pressures, ShearControl(shift=(0.0, 0.0)))
    stiffness = normal.stiffness(pressed).approach, sideways.stiffness(stuck)[0]
    ratios.append(stiffness[1] / stiffness[0])
    print(f"{force:9.0f} {1e-3 * stiffness[0]:14.1f} {1e-3 * stiffness[1]:18.1f} {ratios[-1]:6.3f}")


# %% [markdown]
# Damping: clamped with 200 N, the plane swings by growing amplitudes, here as parts of the shift at
# which the stiffness of sticking would reach the friction. The loss factor is the energy of a cycle
# over 2π times half of force times amplitude. Beside it stands Mindlin's sphere of the same load
# and stiffness.

# %%
CLAMPED = 200.0
PARTS = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)[3 * choice.quick :]
pressures = normal.press(Control(force=CLAMPED)).pressures
stuck = sideways.advance(None, pressures, ShearControl(shift=(0.0, 0.0)))
sticking = sideways.stiffness(stuck)[0]
amplitudes = FRICTION * CLAMPED / sticking * np.array(PARTS)
sliding = 1.5 * FRICTION * CLAMPED / sticking  # shift at which a sphere slides


def cycle(amplitude: float) -> tuple[float, float]:
    """Return the largest shear force of a cycle [N] and the energy that it loses [mJ]."""
    state, losses = stuck, []
    for shift in (amplitude, -amplitude, amplitude):
        state = sideways.advance(state, pressures, ShearControl(shift=(shift, 0.0)))
        losses.append(state.dissipated)
    return state.force[0], losses[-1] - losses[0]


forces, lost = np.array([cycle(amplitude) for amplitude in amplitudes]).T
factors = lost / (np.pi * forces * amplitudes)
secants = forces / amplitudes
short = amplitudes[amplitudes < sliding]
part = short / sliding  # Johnson, Contact Mechanics, eq. 7.57
mindlin = 2.0 * part - 0.8 * (1.0 - (1.0 - part) ** 2.5) - part * (1.0 - (1.0 - part) ** 1.5)
mindlin *= 4.0 * FRICTION * CLAMPED * sliding
print("amplitude [nm]  stiffness [N/µm]  lost per cycle [nJ]  loss factor")
for row in zip(1e6 * amplitudes, 1e-3 * secants, 1e6 * lost, factors, strict=True):
    print("{:14.1f} {:17.1f} {:20.4g} {:12.4f}".format(*row))
small = 2 if choice.quick else 4
exponent, of_sphere = (
    np.polyfit(np.log(amplitudes[:small]), np.log(energies[:small]), 1)[0]
    for energies in (lost, mindlin)
)
print(f"up to {1e6 * amplitudes[small - 1]:.0f} nm the energy grows with the power {exponent:.3f},")
print(f"that of Mindlin's sphere with {of_sphere:.3f}")

# %%
style.use_style()
figure = style.new_figure(style.FULL_WIDTH, 2.6)
left, middle, right = figure.subplots(1, 3)
left.semilogx(FORCES, ratios, "o-", color=style.BLUE)
left.axhline(MINDLIN, color=style.VERMILLION)
left.text(FORCES[0], MINDLIN - 0.004, "2 (1 − ν)/(2 − ν)", color=style.VERMILLION, va="top")
left.set_xticks(FORCES, [f"{force:g}" for force in FORCES])
left.minorticks_off()
left.set(xlabel="clamping force [N]", ylabel="tangential over normal stiffness", ylim=(0.75, 0.9))
per_cube = 1e-6 * lost / amplitudes**3, 1e-6 * mindlin / short**3  # [µJ/µm³]
middle.semilogx(1e6 * amplitudes, per_cube[0], "o-", color=style.BLUE, label="joint")
middle.semilogx(1e6 * short, per_cube[1], color=style.VERMILLION, label="Mindlin's sphere")
middle.legend()
middle.set(xlabel="amplitude [nm]", ylim=(0.0, None))
middle.set_ylabel("loss per cycle / amplitude³ [µJ/µm³]")
right.semilogx(1e6 * amplitudes, 1e-3 * secants, "o-", color=style.BLUE)
right.set(xlabel="amplitude [nm]", ylabel="stiffness [N/µm]", ylim=(0.0, None))
factor = right.twinx()
factor.grid(False)  # it would cross the points
factor.semilogx(1e6 * amplitudes, factors, "s-", color=style.VERMILLION)
factor.set(ylim=(0.0, None))
factor.set_ylabel("loss factor", color=style.VERMILLION)
figure.savefig(choice.out / "joint_damping.png")

# %% [markdown]
# The ratio is that of Mindlin's sphere; small vibrations lose with the third power.

# %%
assert np.abs(np.array(ratios) / MINDLIN - 1.0).max() < 0.03
assert abs(exponent - 3.0) < (0.5 if choice.quick else 0.06)
assert np.all(np.diff(factors) > 0.0) and factors[-1] < 4.0 / np.pi  # that of sliding alone
