"""What choices that are easily made otherwise change in the force of the first example.

    python benchmarks/why_forces_differ.py

The map of ground steel of ``demos/scenes/my_surface.toml``, elastic, is pressed again with one
thing changed: under the force of the scene, for its approach and area, and to the approach of the
scene, for its force.
"""

from pathlib import Path

from patchlaw import Scene, run

ROOT = Path(__file__).resolve().parents[1]
FORCE, APPROACH = "20 N", "0.59 um"  # the second is what the first gives, elastic

CHANGES = {
    "as it is": {},
    "half-space with free sides and no body": {"coupling.kind": "analytic"},
    "sides on rollers": {"block.sides": "roller"},
    "block 0.1 mm high": {"block.height": "0.1 mm"},
    "periodic": {"coupling.kind": "analytic", "surface.periodic": True},
    "small slopes": {"micro.finite_slopes": False},
    "steel half-space on the other side": {
        "counter_body": {"young_modulus": "210 GPa", "poisson_ratio": 0.3}
    },
    "not detrended": {"surface.detrend": "none"},
    "not detrended, plane free to turn": {"surface.detrend": "none", "load.tilt": "free"},
    "quadratic form removed": {"surface.detrend": "quadratic"},
    "spikes kept": {"surface.outliers": "keep"},
    "short cut-off 5 um": {"surface.filter.short": "5 um"},
    "short cut-off 20 um": {"surface.filter.short": "20 um"},
    "long cut-off 0.25 mm": {"surface.filter.long": "0.25 mm"},
    "half of the heights a side": {"surface.resample": [96, 96]},
    "twice the heights a side": {"surface.resample": [384, 384]},
    "elliptic asperities": {"coupling.kind": "analytic", "micro.model": "elliptic"},
    "hardness 7 GPa": {"micro.hardness": "7 GPa"},
    "hardness 2.5 GPa": {"micro.hardness": "2.5 GPa"},
}


def main():
    scene = Scene.load(ROOT / "demos" / "scenes" / "my_surface.toml").with_(
        {"micro.hardness": None, "load.steps": 1, "output.check": "none", "output.contact": "none"}
    )
    print("| changed | approach under 20 N | area | force at 0.59 µm |\n|---|---|---|---|")
    for name, changes in CHANGES.items():
        loaded = run(scene.with_({**changes, "load.force": FORCE})).steps[-1]
        moved = run(scene.with_({**changes, "load.approach": APPROACH})).steps[-1]
        print(
            f"| {name} | {1e3 * loaded.approach_mm:.3f} µm | "
            f"{100 * loaded.contact_area_fraction:.2f} % | {moved.force_N:.2f} N |",
            flush=True,
        )


if __name__ == "__main__":
    main()
