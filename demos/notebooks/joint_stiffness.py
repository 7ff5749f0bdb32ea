# %% [markdown]
# # The stiffness of a joint
#
# Two flat plates of steel that touch are softer than one piece, because they touch on spots. What
# one learns: the stiffness of the interface grows faster than the pressure on few waves of
# roughness; the more a bolt pulls, the less the interface matters.

# %%
# %matplotlib inline
import matplotlib.pyplot as plt
import numpy as np

from patchlaw import Scene, run

scene = Scene.from_dict(
    {
        "surface": {
            "spectrum": {"hurst": 0.8, "waves": [3, 24], "rms_slope": 0.1, "seed": 5},
            "grid": [128, 128],
            "lengths": ["1 mm", "1 mm"],
        },
        "block": {"young_modulus": "105 GPa", "poisson_ratio": 0.3},  # two plates of 210 GPa
        "coupling": {"kind": "analytic"},
        "load": {"pressure": "100 MPa", "steps": 10},
        "output": {"check": "none"},
    }
)

# %% [markdown]
# A rigid plane and one body of half Young's modulus stand for two elastic bodies: the contact
# modulus is the same.

# %%
history = run(scene, progress=True)
history

# %% [markdown]
# Every load step knows the stiffness of the interface, the derivative of the force by the mean gap,
# from one more linear problem on the spots in contact. The half-space around them, which gives way
# to the load as a whole, is no part of it. Differences between load steps, which need no
# derivative, must lie between the values at both ends.

# %%
pressure = history.mean_pressure_MPa
stiffness = history.interface_stiffness_N_per_mm  # of 1 mm²: N/mm per mm²
differences = -np.diff(history.force_N) / np.diff(history.mean_separation_mm)
exponent = np.polyfit(np.log(pressure), np.log(stiffness), 1)[0]
print(f"stiffness ~ pressure^{exponent:.2f}; at 100 MPa {1e-3 * stiffness[-1]:.0f} N/µm per mm²")

# %%
figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
axes.loglog(pressure, 1e-3 * stiffness, "o-", label="at the load steps")
middle = np.sqrt(pressure[1:] * pressure[:-1])
axes.loglog(middle, 1e-3 * differences, "x", label="differences between them")
axes.set(xlabel="mean pressure [MPa]", ylabel="stiffness of 1 mm² [N/µm]")
axes.legend()
plt.show()

# %% [markdown]
# Beside two plates of 10 mm each, which are springs in a row with the interface:

# %%
plates = 210e3 / 20.0  # N/mm per mm²
share = (1 / stiffness) / (1 / stiffness + 1 / plates)
for step in (0, -1):
    print(
        f"{pressure[step]:5.0f} MPa: {100 * share[step]:.1f} % of the compliance is the interface"
    )

# %%
assert np.all((stiffness[:-1] < differences) & (differences < stiffness[1:]))
assert 1.1 < exponent < 1.35
assert share[0] > 3 * share[-1]
