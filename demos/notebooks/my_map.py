# %% [markdown]
# # My map: from heights to a force
#
# A map of ground steel, 192 × 192 heights in µm as an interferometer delivers them, is prepared
# and pressed with 20 N. What one learns: how far the steel approaches the plane, on how many spots
# it rests, and how certain both are.

# %%
import numpy as np

from patchlaw import Scene, run

heights = np.loadtxt("../scenes/ground_steel.txt")
heights.shape, f"{np.isnan(heights).sum()} missing, {np.nanmax(heights):.2f} µm at most"

# %% [markdown]
# The heights go into a scene as an array. The keys are those of a scene file: the tilt of the
# specimen is removed, specks of dust and missing heights are replaced, and waves below 8 µm, the
# noise of the instrument, are filtered. A scene shows what was written.

# %%
scene = Scene.from_dict(
    {
        "surface": {
            "heights": 1e-3 * heights,  # mm
            "lengths": ["0.48 mm", "0.48 mm"],
            "missing": "fill",
            "outliers": "remove",
            "detrend": "plane",
            "filter": {"short": "8 um"},
        },
        "block": {"young_modulus": "210 GPa", "poisson_ratio": 0.3},
        "micro": {"hardness": "2.5 GPa"},  # summits yield at this pressure
        "coupling": {"kind": "concurrent"},
        "load": {"force": "20 N", "steps": 4},
    }
)
scene

# %%
history = run(scene, progress=True)
history

# %% [markdown]
# Every column is an array, an index gives a load step, and a slice the history of some. The error
# of the last approach is measured in the run.

# %%
last = history[-1]
print(
    f"{1e3 * last.approach_mm:.4f} ± {1e3 * last.approach_error_mm:.4f} µm at {last.force_N:.0f} N"
)
print("spots:", history.contacts, " upper half of the load:", history[2:].force_N, "N")

# %% [markdown]
# The contact itself: the spots that carry most, then maps of pressure and gap.

# %%
history.contact

# %%
history.contact.plot()

# %%
assert abs(1e3 * last.approach_mm - 0.6028) < 0.0029  # what the page on this map says
assert history.contact.force_N > 19.99
