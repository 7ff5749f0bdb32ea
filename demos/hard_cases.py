# %% [markdown]
# # Hard cases
#
# What one learns: what contact of rough surfaces finds hard, and how many iterations it takes here.
# Every row is a scene far from the usual one (a 1 mm cube, 4 × 4 patches, 8 µm), or a pair of
# summits. What must hold in each is asserted in `tests/verification/test_hard_cases_*.py`,
# `test_interaction_merging.py` and `tests/unit/macro/test_multigrid.py`; here they are counted.
#
# Run time: 2 min. `--quick` for fewer load steps, `--out DIR` for the folder of table and figure.

# %%
import argparse
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from geometry import Asperities, NotConverged
from micro import asperity_model
from multiscale import Scene, run

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/hard_cases"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
SIZE = 16 if choice.quick else 64
USUAL = [f"surface.grid=[{SIZE}, {SIZE}]", "block.cells=[8, 8, 6]", "micro.model=half-space"]
USUAL += ["surface.spectrum.waves=[2, 6]", "load.steps=1"]
LAWS, WHOLE = "coupling.kind=consistent", "coupling.kind=concurrent"
MESH = ["coupling.kind=isolated", "coupling.newton=full"]
x = (np.arange(SIZE) + 0.5) / SIZE - 0.5
DOME = -(x[:, None] ** 2 + x**2) / 0.8


def heights(name: str, values: np.ndarray) -> list[str]:
    """Write heights, and return what to change in the scene for them."""
    np.save(choice.out / f"{name}.npy", values)
    return [f"surface.file={name}.npy"]


FLAT, SPIKE, GAPS = np.zeros((SIZE, SIZE)), 0.1 * DOME, DOME.copy()
SPIKE[SIZE // 4, SIZE // 3] += 0.02
GAPS[: SIZE // 5, : SIZE // 5] = np.nan
LAPS = 10 if choice.quick else 500
FORCES = "load.force=['1e-9 N', '1e-3 N', '1 N', '0 N']"
CASES = {
    "1 first touch, from 1e-10 mm": [LAWS, "load.approach=[1e-10, 1e-6, 8e-3, 0.0]"],
    "2 full contact and beyond": [LAWS, "load.approach=['2 mm']", "block.height=3 mm"],
    "3 one patch": [LAWS, "patches.grid=[1, 1]"],
    "3 256 patches": [WHOLE, "patches.grid=[16, 16]"],
    "6 ν = 0.4999, Q1 on the mesh: locks": [*MESH, "block.poisson_ratio=0.4999"],
    "6 ν = 0.4999, Q2 on the mesh": [*MESH, "block.poisson_ratio=0.4999", "block.element=Q2"],
    "6 ν = 0.4999, decomposed": [LAWS, "block.poisson_ratio=0.4999"],
    "6 ν = −0.5": [*MESH, "block.poisson_ratio=-0.5"],
    "7 E = 1 kPa": [LAWS, "block.young_modulus=1 kPa"],
    "7 E = 1 TPa": [LAWS, "block.young_modulus=1 TPa"],
    "8 pancake 50 : 1": [*MESH, "block.height=0.02 mm"],
    "8 column 1 : 50": [*MESH, "block.height=50 mm"],
    "9 a step 100 times too large, and back": [WHOLE, "load.approach=['0.8 mm', '8 um', '0 um']"],
    "10 tilt, half the patches open": [LAWS, "load.tilt=['40 um/mm', '0 um/mm']"],
    "11 approach shifted by 1e-4": [LAWS, "load.approach=['8 um', '8.0008 um', '7.9992 um']"],
    "13 spike": [LAWS, *heights("spike", SPIKE)],
    "13 step": [LAWS, *heights("step", np.where(x[:, None] > 0.0, 0.01, 0.0) + FLAT)],
    "13 plateau": [LAWS, *heights("plateau", np.minimum(DOME, -0.02))],
    "13 flat, patches alone": [MESH[0], *heights("flat", FLAT)],
    "14 missing heights, filled": [LAWS, *heights("gaps", GAPS), "surface.missing=fill"],
    "15 patch as large as the block": [MESH[0], "patches.grid=[1, 1]", "block.height=0.2 mm"],
    "16 force through first touch": [LAWS, FORCES],
    "16 the same without laws": [WHOLE, FORCES],
    f"17 {20 * LAPS} load steps": [LAWS, f"load.approach={[8e-3, 2e-3] * LAPS}", "load.steps=10"],
    "20 reference without a contact node": [
        "coupling.kind=reference", "block.cells=[4, 4, 2]", "load.approach=0.1 um"
    ],
}  # fmt: skip


# %%
def solved(changes: list[str]) -> tuple[str, int, int, int]:
    """Return the result of a scene, its load steps, Newton and linear iterations."""
    other = {"surface.file": ("spectrum", "grid = [256"), "load.force": ("approach",)}
    out = [start for key in other for start in other[key] if key in " ".join(changes)]
    lines = PAPER.read_text(encoding="utf-8").splitlines()
    base = choice.out / "base.toml"  # the paper's scene without what contradicts the changes
    base.write_text("\n".join(text for text in lines if not text.startswith(tuple(out))))
    usual = [text for text in USUAL if "spectrum" not in out or not text.startswith("surface")]
    found = run(Scene.load(base, [*usual, *changes]))
    newton, linear = int(found.newton_iterations.sum()), int(found.linear_iterations.sum())
    return f"{found.force_N.max():.6g} N", len(found), newton, linear


def pair(ratio: float, apart: float) -> tuple[str, int, int, int]:
    """Return the result of two summits, 0.02 mm pressed, and the iterations."""
    both, none, minor = np.ones(2), np.zeros(2), 0.1 / np.sqrt(ratio)
    summits = Asperities(
        x=np.array([0.5, 0.5 + apart]), y=0.5 * both, z=none, radius_major=ratio * minor * both,
        radius_minor=minor * both, angle=none, lengths=(1.0, 1.0), highest=0.0, mean_height=0.0,
    )  # fmt: skip
    state = asperity_model("elliptic", summits, contact_modulus=4000.0).solve(0.02)
    return f"{state.force.sum():.6g} N", 1, int(state.iterations), 0


work = {name: (solved, (changes,)) for name, changes in CASES.items()}
work |= {"4 merging summits": (pair, (4.0, 0.04)), "5 radii 10⁶ : 1": (pair, (1e6, 0.3))}
work |= {"19 summits 1e-9 mm apart": (pair, (1.0, 1e-9))}
rows = []
for name in sorted(work, key=lambda text: int(text.split()[0])):
    began = time.perf_counter()
    try:
        result, steps, newton, linear = work[name][0](*work[name][1])
    except NotConverged as error:
        result, steps, newton, linear = error.args[0], 0, 0, 0
    rows.append((name, result, steps, newton, linear, time.perf_counter() - began))
table = ["| case | largest force | load steps | Newton | linear | s |", "|---|---|---|---|---|---|"]
table += ["| {} | {} | {} | {} | {} | {:.2f} |".format(*row) for row in rows]
(choice.out / "hard_cases.md").write_text("\n".join(table) + "\n", encoding="utf-8")
print("\n".join(table))

# %%
axes = (figure := Figure(figsize=(9.6, 7.0), layout="constrained")).subplots()
per_step = [newton / max(steps, 1) for _, _, steps, newton, _, _ in rows]
axes.barh([row[0] for row in rows], per_step, color="0.5")
axes.invert_yaxis()
axes.set(xlabel="Newton iterations per load step")
axes.grid(axis="x", alpha=0.3)
figure.savefig(choice.out / "hard_cases.png", dpi=130)
assert max(per_step) <= 20 and min(row[2] for row in rows) >= 1, rows
