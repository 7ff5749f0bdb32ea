# %% [markdown]
# # Sweep and scatter
#
# Two surfaces of one specification are not the same surface. What one learns: how far the approach
# of a joint scatters from specimen to specimen, and whether a finer finish or the luck of the draw
# matters more.

# %%
# %matplotlib inline
import matplotlib.pyplot as plt
import numpy as np

from patchlaw import Scene, sweep

scene = Scene.from_dict(
    {
        "surface": {
            "spectrum": {"hurst": 0.8, "waves": [2, 12], "rms_slope": 0.1, "seed": 1},
            "grid": [64, 64],
            "lengths": ["1 mm", "1 mm"],
        },
        "block": {"young_modulus": "70 GPa", "poisson_ratio": 0.33},
        "coupling": {"kind": "analytic"},
        "load": {"force": "100 N", "steps": 4},
        "output": {"check": "none"},
    }
)

# %% [markdown]
# Eight draws for each of two rms gradients. All other keys of a scene can be varied in the same
# way; a value may be a file.

# %%
vary = {"surface.spectrum.rms_slope": [0.05, 0.1], "surface.spectrum.seed": range(1, 9)}
cases = sweep(scene, vary, progress=True)
cases

# %% [markdown]
# A column of the history is an array of shape (cases, steps). Draws of one specification are an
# ensemble, which has a mean and quantiles.

# %%
print("approaches", cases.approach_mm.shape)
scatter = {}
for values, ensemble in cases.ensembles():
    slope = values["surface.spectrum.rms_slope"]
    final = 1e3 * ensemble.approach_mm[:, -1]
    scatter[slope] = final
    low, high = 1e3 * ensemble.band("approach_mm")[:, -1]
    print(
        f"rms gradient {slope}: {final.mean():.2f} µm at 100 N, deviation {final.std(ddof=1):.2f}, "
        f"nine of ten in {low:.2f} to {high:.2f}"
    )

# %%
cases.plot()

# %% [markdown]
# The draws side by side: surfaces of the same seed differ by their slope alone.

# %%
figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
for slope, final in scatter.items():
    axes.plot(np.arange(1, 9), final, "o-", label=f"rms gradient {slope}")
axes.set(xlabel="seed", ylabel="approach at 100 N [µm]", ylim=(0, None))
axes.legend()
plt.show()

# %%
assert np.all(scatter[0.05] < scatter[0.1])  # the finer finish wins, whatever the draw of its twin
assert cases.approach_mm.shape == (16, 4) and not cases.failures
