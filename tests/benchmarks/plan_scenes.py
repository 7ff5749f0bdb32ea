"""The scenes of `plan_predictions.py`: TOML text, ranks and threads by name."""

SOFT = 'young_modulus = "4 GPa"\npoisson_ratio = 0.15\n'
STEEL = 'young_modulus = "210 GPa"\npoisson_ratio = 0.3\n'


def scene(kind, grid, load, *more, waves=(2, 16), slope=0.15, seed=1, block=SOFT, surface=""):
    """Return the text of a scene of one square millimetre; ``more`` are further sections."""
    return f"""
[surface]
spectrum = {{{{ hurst = 0.8, waves = {list(waves)}, rms_slope = {slope}, seed = {seed} }}}}
grid = [{grid}, {grid}]
lengths = ["1 mm", "1 mm"]
{surface}
{f"[block]{chr(10)}{block}" if block else ""}
[coupling]
kind = "{kind}"
[load]
{load}
{chr(10).join(more)}
"""


def by(steps, *, approach=None, force=None, rest=""):
    """Return the section on the load."""
    value = f'approach = "{approach} um"' if approach else f'force = "{force} N"'
    return f"{value}\nsteps = {steps}\n{rest}"


def body(mesh, contact, support, *more):
    """Return the section on a body of a mesh in the benchmark's folder."""
    return (
        f'[body]\nmesh = "{{folder}}/{mesh}"\ncontact = "{contact}"\n'
        f'supports = [{{{{ surface = "{support}", displacement = ["0", "0", "0"] }}}}]\n{SOFT}'
        + "\n".join(more)
    )


NO_FIGURES = "[output]\nfigures = false\nreport = false"
SMALL_SLOPES = "[micro]\nfinite_slopes = false"
ELLIPTIC = '[micro]\nmodel = "elliptic"'
SAMPLE = '[law]\nkind = "representative"'

SCENES = {
    "analytic-64": (scene("analytic", 64, by(8, approach=5)), 1, 1),
    "analytic-128-force": (scene("analytic", 128, by(4, force=2), seed=2), 1, 2),
    "analytic-256-periodic": (
        scene("analytic", 256, by(4, force=4), surface="periodic = true"), 1, 1,
    ),
    "analytic-512": (scene("analytic", 512, by(4, approach=4), waves=(2, 64), seed=3), 1, 2),
    "analytic-512-bare": (
        scene("analytic", 512, by(2, approach=6), SMALL_SLOPES, NO_FIGURES), 1, 1,
    ),
    "analytic-1024": (
        scene("analytic", 1024, by(2, approach=4), SMALL_SLOPES, waves=(2, 64)), 1, 2,
    ),
    "analytic-2048-force": (
        scene("analytic", 2048, by(1, force=40), NO_FIGURES, waves=(4, 256), block=STEEL), 1, 2,
    ),
    "analytic-4096": (
        scene("analytic", 4096, by(1, approach=1), '[output]\ncheck = "none"\nfigures = false',
              waves=(4, 512), block=STEEL, slope=0.1), 1, 2,
    ),
    "elliptic-256": (scene("analytic", 256, by(8, approach=6), ELLIPTIC), 1, 1),
    "elliptic-1024": (scene("analytic", 1024, by(4, force=1), ELLIPTIC, waves=(2, 64)), 1, 1),
    "concurrent-64": (scene("concurrent", 64, by(8, approach=6)), 1, 1),
    "concurrent-128-all": (
        scene("concurrent", 128, by(4, approach=6), '[output]\ncheck = "all"'), 1, 1,
    ),
    "concurrent-128-tilt": (scene("concurrent", 128, by(4, force=2, rest='tilt = "free"')), 1, 2),
    "concurrent-256": (scene("concurrent", 256, by(8, approach=8), slope=0.215), 1, 2),
    "concurrent-256-hard": (
        scene("concurrent", 256, by(4, force=4), '[micro]\nhardness = "400 MPa"', seed=5), 1, 1,
    ),
    "concurrent-256-ranks": (scene("concurrent", 256, by(8, approach=6), seed=4), 2, 1),
    "concurrent-512": (scene("concurrent", 512, by(4, force=2), waves=(2, 32)), 1, 2),
    "concurrent-1024": (
        scene("concurrent", 1024, by(2, approach=6), '[output]\ncheck = "none"', waves=(2, 64)),
        1, 2,
    ),
    "concurrent-2048": (
        scene("concurrent", 2048, by(1, approach=3), SMALL_SLOPES,
              '[output]\ncheck = "none"\nfigures = false', waves=(4, 128)), 1, 2,
    ),
    "consistent-64": (scene("consistent", 64, by(8, approach=6)), 1, 1),
    "consistent-128": (scene("consistent", 128, by(8, force=2), seed=2), 1, 2),
    "consistent-256-256-patches": (
        scene("consistent", 256, by(8, approach=6), "[patches]\ngrid = [16, 16]"), 1, 2,
    ),
    "consistent-elliptic": (scene("consistent", 256, by(40, approach=6), ELLIPTIC), 1, 1),
    "isolated-256-elliptic": (scene("isolated", 256, by(8, approach=6), ELLIPTIC), 1, 1),
    "isolated-256-ranks": (scene("isolated", 256, by(8, approach=6), seed=6), 2, 1),
    "reference-hexahedra": (
        scene("reference", 128, by(4, approach=6),
              '[reference]\nmesh = "hexahedra"\ncells = [32, 32, 12]\nmeshes = 2', waves=(2, 8)),
        1, 1,
    ),
    "reference-tetrahedra": (
        scene("reference", 128, by(2, approach=6), "[reference]\nmeshes = 1", waves=(2, 6)), 2, 1,
    ),
    "representative-128": (
        scene("consistent", 128, by(4, force=20), body("box.msh", "top", "bottom"), SAMPLE,
              block=None).replace('[coupling]\nkind = "consistent"\n', ""), 1, 2,
    ),
    "body-concurrent-128": (
        scene("concurrent", 128, by(4, approach=6), body("box.msh", "top", "bottom"), block=None),
        1, 2,
    ),
    "body-consistent-128": (
        scene("consistent", 128, by(4, approach=6),
              body("box.msh", "top", "bottom"), block=None), 1, 1,
    ),
    "fields-256": (
        scene("concurrent", 256, by(4, approach=6), '[output]\nfields = "last"', seed=7), 1, 1,
    ),
}  # fmt: skip
"""TOML text with a place for the folder, ranks, and threads of each scene."""
