"""A small rough block, as sections of a scene, that tests of what cells do press."""

from patchlaw.multiscale import Scene


def pressed_cells(kind, load, *, periodic=False, **sections):
    """Return the scene of 24 × 24 heights under a load.

    Args:
        kind: The coupling.
        load: Section of the load.
        periodic: Whether the surface continues periodically.
        sections: Further sections, or others in place of those here; None leaves one out.
    """
    spectrum = {"hurst": 0.95, "waves": [2, 6], "rms_slope": 0.2, "seed": 1}
    grid = {"grid": [24, 24], "lengths": [1.0, 1.0], "periodic": periodic}
    data = {
        "surface": {"spectrum": spectrum, **grid},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
        "patches": {"grid": [2, 2]},
        "coupling": {"kind": kind},
        "load": load,
        "output": {"check": "none", "figures": False, "report": False},
    } | sections
    return Scene.from_dict({name: part for name, part in data.items() if part is not None})
