# %% [markdown]
# # Hard cases
#
# What one learns: which cases of rough contact are numerically difficult, what the right result is,
# how large the error is and how many iterations it takes. Every row is a scene far from the usual
# one (a 1 mm cube, 4 × 4 patches, 8 µm), a pair of summits or a law; it is compared with a closed
# form, another coupling or another way to the same load. The same is asserted, for more couplings,
# in `tests/verification/test_hard_cases_*.py` and `test_interaction_merging.py`.
#
# Run time: 2 min. `--quick` for one case of each kind, `--out DIR` for the folder of
# table and figure.

# %%
import argparse
import time
from pathlib import Path

from hard import bench, blocks_and_loads, surfaces
from hard.bench import CASES, Count

from patchlaw import NotConverged
from patchlaw.multiscale.results.figures.style import (
    BLUE,
    FULL_WIDTH,
    INK,
    SKY,
    new_figure,
    use_style,
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/hard_cases"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
blocks_and_loads.LAPS = 3 if choice.quick else 100
if choice.quick:
    bench.TABLES = 1e-2
    blocks_and_loads.MODULI, blocks_and_loads.UNITS = (1e3,), {"um": 1e-3}
assert surfaces.CELLS == 32

# %% [markdown]
# Each case returns its error and what was solved for it. An error beyond its bound, or an
# iteration that does not converge, ends the demo.

# %%
rows, errors = [], []
for case in sorted(CASES, key=lambda one: one.number):
    if choice.quick and any(case.number == row[0].number for row in rows):
        continue  # one of each kind
    began = time.perf_counter()
    try:
        error, *found = case.solve()
    except NotConverged as failure:
        raise SystemExit(f"case {case.number}, {case.hard}: {failure}") from failure
    counts = [Count.of(one) for one in found]
    work = Count(
        **{
            name: sum(getattr(one, name) for one in counts)
            for name in ("steps", "newton", "linear", "contact")
        }
    )
    rows.append((case, float(error), work, time.perf_counter() - began))
    if error > case.bound:
        errors.append(f"case {case.number}, {case.hard}: off by {error:.1e}")

HEAD = (
    "| | what is difficult | what must hold | error | bound | load steps | Newton | linear | CG |"
)
table = [HEAD, "|--:|---|---|--:|--:|--:|--:|--:|--:|"]
for case, error, work, _ in rows:
    off = "0" if error == 0.0 else f"{error:.1e}"
    counted = " | ".join(str(n or "–") for n in (work.newton, work.linear, work.contact))
    table.append(
        f"| {case.number} | {case.hard} | {case.holds} | {off} | {case.bound:g} "
        f"| {work.steps} | {counted} |"
    )
(choice.out / "hard_cases.md").write_text("\n".join(table) + "\n", encoding="utf-8")
print("\n".join(table))
print(f"{len(rows)} cases in {sum(row[-1] for row in rows):.0f} s")

# %% [markdown]
# Left the iterations of a load step: of Newton's method, or, without laws, of conjugate gradients
# for the contacts. Right the error of each case beside its bound.

# %%
use_style()
figure = new_figure(FULL_WIDTH, 0.16 * len(rows) + 0.9)
left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 1.2))
names = [f"{case.number}  {case.hard}" for case, *_ in rows]
place = range(len(rows))
newton, gradients = (
    [getattr(work, name) / work.steps for _, _, work, _ in rows] for name in ("newton", "contact")
)
left.barh(place, newton, color=BLUE, height=0.7, label="Newton's method")
left.barh(place, gradients, color=SKY, height=0.7, label="conjugate gradients")
left.set(xlabel="iterations per load step", yticks=place, yticklabels=names)
left.legend(loc="lower right")
right.barh(place, [case.bound for case, *_ in rows], left=1e-16, color="0.85", height=0.7)
right.plot([max(error, 1e-16) for _, error, *_ in rows], place, "o", color=INK)
right.set(xscale="log", xlim=(1e-16, 2.0), xlabel="error, and its bound (bar)")
left.set(ylim=(len(rows) - 0.4, -0.6))  # from above
for axes in (left, right):
    axes.grid(axis="y", visible=False)
answer = f"All {len(rows)} cases, at most {max(newton):.0f} Newton steps or {max(gradients):.0f} "
about = {"answer": answer + "iterations of conjugate gradients a load step"}
figure.savefig(choice.out / "hard_cases.png", metadata=about, pil_kwargs={"optimize": True})
assert not errors, errors
assert {case.number for case, *_ in rows} == set(range(1, 21))
assert max(newton) <= 10, rows
assert max(gradients) <= 80, rows
