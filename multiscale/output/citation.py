"""How to cite patchlaw, as CITATION.cff says it."""

from __future__ import annotations

from importlib.metadata import version

PAPER = (
    "Y. Waddad, V. Magnier, P. Dufrénoy, G. De Saxcé: A multiscale method for frictionless contact "
    "mechanics of rough surfaces. Tribology International (2016), "
    "doi 10.1016/j.triboint.2015.12.023"
)
"""The paper whose method is implemented."""


def citations() -> tuple[str, str]:
    """Return the references of the program, in the installed version, and of the paper."""
    program = (
        "The patchlaw developers: patchlaw: multiscale contact of rough surfaces in FEniCSx. "
        f"Version {version('patchlaw')}"
    )
    return program, PAPER
