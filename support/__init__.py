"""What every package above stands on: errors, checks, MPI, threads, optional packages, whole files.

Nothing here knows of surfaces or contact. Types of arrays, errors, checks of arguments and what
ranks do together are taken from here; all else from its module.
"""

from patchlaw.support.packages import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
