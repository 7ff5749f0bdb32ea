# %% [markdown]
# # Laws for CalculiX
#
# A solver that knows nothing of roughness takes it as pressure over overclosure. What one learns:
# how the laws of a surface look, what stands in the file for CalculiX, and how closely the
# straight lines of its tables follow the laws.

# %%
import re
import tempfile
from pathlib import Path

# %matplotlib inline
import matplotlib.pyplot as plt
import numpy as np

from patchlaw import Run, Scene, export_laws

scene = Scene.from_dict(
    {
        "surface": {
            "spectrum": {"hurst": 0.8, "waves": [2, 12], "rms_slope": 0.1, "seed": 7},
            "grid": [64, 64],
            "lengths": ["1 mm", "1 mm"],
        },
        "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.2},
        "patches": {"grid": [2, 2]},
        "coupling": {"kind": "isolated"},
        "load": {"approach": "8 um", "steps": 4},
    }
)

# %% [markdown]
# Isolated laws belong to the surface alone, so that they hold on any mesh. There is one for each
# of the four patches.

# %%
laws = Run(scene).make_laws()
laws

# %%
laws[0]

# %%
figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
for number, law in enumerate(laws.laws):
    closure = np.linspace(*law.range, 200)
    axes.plot(1e3 * closure, law.pressure(closure), label=f"patch {laws.grid.unravel(number)}")
axes.set(xlabel="closure [µm]", ylabel="pressure [MPa]")
axes.legend()
plt.show()

# %% [markdown]
# The file has a surface interaction for each patch. CalculiX reads it with `*INCLUDE,
# INPUT=laws_calculix.inp` and `*CONTACT PAIR, INTERACTION=PATCH_0_0, TYPE=NODE TO SURFACE`; its
# first lines say what else to mind.

# %%
folder = tempfile.TemporaryDirectory()
(path,) = export_laws(laws, folder.name, "calculix")
text = Path(path).read_text(encoding="utf-8")
folder.cleanup()
print("\n".join(line[:100] for line in text.splitlines()[:24]))

# %% [markdown]
# Between the rows of the first table CalculiX draws straight lines. Mortar contact provides for 40
# rows and wants slopes that rise. The largest distance of the lines from the law, relative to the
# pressure or to 1 % of the largest pressure where that is more:

# %%
table = re.split(r"\*SURFACE INTERACTION", text, flags=re.IGNORECASE)[1]
rows = [line.split(",") for line in table.splitlines() if re.match(r"\s*[-+.0-9]", line)]
pressure, overclosure = np.array([row[:2] for row in rows if len(row) == 2], float).T
law = laws[0]
inside = np.linspace(law.first_touch, min(law.range[1], overclosure[-1]), 2001)[1:]
exact, drawn = law.pressure(inside), np.interp(inside, overclosure, pressure)
error = np.max(np.abs(drawn - exact) / np.maximum(exact, 0.01 * exact[-1]))
print(f"{len(pressure)} rows, error of the straight lines {error:.2e}")

# %%
assert len(pressure) <= 40
assert 0.0 < error < 3e-3  # of the law's own interpolation
