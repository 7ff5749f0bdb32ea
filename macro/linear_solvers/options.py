"""PETSc's solvers under one prefix, with defaults that the user's options override."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from petsc4py import PETSc

from patchlaw.macro.compat import call
from patchlaw.support import InputError

T = TypeVar("T")

PREFIX = "patchlaw_"
"""Prefix of every PETSc option: ``-patchlaw_ksp_rtol 1e-6`` on the command line wins."""

KRYLOV_DEFAULTS: Mapping[str, object] = {
    "ksp_type": "cg",
    "ksp_norm_type": "unpreconditioned",
    "ksp_rtol": 1e-10,
    "ksp_max_it": 1000,
}
"""Conjugate gradients, whatever the preconditioner."""

UNSYMMETRIC: Mapping[str, object] = {"ksp_type": "gmres", "ksp_gmres_restart": 100}
"""For tangents of friction, which are unsymmetric where closures change."""

ALGEBRAIC_DEFAULTS: Mapping[str, object] = {
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.01,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_ksp_chebyshev_esteig": "0,0.05,0,1.1",
    "mg_levels_esteig_ksp_max_it": 30,
    "mg_levels_pc_type": "bjacobi",
    "mg_levels_sub_pc_type": "icc",
    "mg_levels_sub_pc_factor_shift_type": "positive_definite",
}
"""Smoothed aggregation, with the rigid body modes of the nodes. On every rank incomplete Cholesky
factors couple the nodes of flat cells, which aggregates of nodes alone hardly see: 8 to 24
iterations to 1e-8 on machine parts of 5·10³ to 14·10³ unknowns, where Jacobi's smoother took 8 to
71 and PETSc's 10 iterations missed the largest eigenvalue of a pad of hexahedra."""

SMOOTHED = "mg_levels_ksp_chebyshev_"
"""Prefix of PETSc's options that say which eigenvalues multigrid smooths."""

GEOMETRIC_DEFAULTS: Mapping[str, object] = {
    "pc_type": "mg",
    "mg_levels_ksp_type": "chebyshev",
    f"{SMOOTHED}esteig": "0,0.1,0,1.1",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_levels_pc_type": "jacobi",
    "mg_coarse_pc_type": "telescope",
    "mg_coarse_telescope_ksp_type": "preonly",
    "mg_coarse_telescope_pc_type": "cholesky",
}
"""Geometric multigrid on grids of the block. One rank alone solves on the coarsest grid, which
saves messages between all ranks. Two smoothing steps before and after: one step took 1.7 to 1.9
times the iterations and three took 0.7 to 0.8 of them, in the same time; Gauss–Seidel took two to
four times as long."""


DIRECT_DEFAULTS = {"pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}
"""A factorisation by MUMPS, distributed over the ranks."""


_MOST_ITERATIONS = 1000
_MOST_VALUES = 1000
"""Eigenvalues that PETSc's estimates are asked for at most."""


def has_hypre() -> bool:
    """Tell whether PETSc was built with hypre; the wheels of dolfinx come without."""
    return bool(PETSc.Sys.hasExternalPackage("hypre"))


def has_mumps() -> bool:
    """Tell whether PETSc was built with MUMPS."""
    return bool(PETSc.Sys.hasExternalPackage("mumps"))


def users_options() -> tuple[tuple[str, str], ...]:
    """Return the user's PETSc options under `PREFIX`, sorted by name; results depend on them."""
    given = PETSc.Options(PREFIX).getAll()
    return tuple(sorted((name, str(value)) for name, value in given.items()))


@contextmanager
def default_options(prefix: str, defaults: Mapping[str, object]) -> Iterator[None]:
    """Set defaults in PETSc's option database where the user set none; remove them at the end.

    Args:
        prefix: Prefix of the options. Without one other solvers would see the defaults.
        defaults: Option names without prefix, and values.

    Raises:
        ValueError: When the prefix is empty.
        InputError: When PETSc refuses an option while they are set.
    """
    if not prefix:
        raise ValueError("PETSc options need a prefix")
    database = PETSc.Options(prefix)
    added = [name for name in defaults if not database.hasName(name)]
    for name in added:
        database.setValue(name, defaults[name])
    try:
        yield
    except PETSc.Error as error:
        raise InputError(
            f"PETSc refuses the solver's options: {str(error).splitlines()[-1]}", key="command line"
        ) from None
    finally:
        for name in added:
            database.delValue(name)


def options_read(prefix: str, names: Iterable[str]) -> set[str]:
    """Return those of some options that PETSc's objects have asked for since they were set.

    Args:
        prefix: Prefix of the options.
        names: Their names without it.
    """
    asked, read = set(), ctypes.c_int(0)
    for name in names:
        call("PetscOptionsUsed", None, f"{prefix}{name}".encode(), ctypes.byref(read))
        asked |= {name} if read.value else set()
    return asked


def iterating(solver: PETSc.KSP, method: str = "cg") -> None:
    """Let a solver iterate whose user asked for a factorisation alone (``-ksp_type preonly``).

    What is factorised is the matrix of the body. The tangent also has contact in it, of which
    entries would couple all nodes of a patch: for it the factors are a preconditioner.

    Args:
        solver: The solver, its options set.
        method: The Krylov method.
    """
    if solver.getType() == "preonly":
        solver.setType(method)


def largest_eigenvalue(smoother: PETSc.KSP) -> float:
    """Return the largest eigenvalue that a Chebyshev smoother estimated of its matrix.

    Args:
        smoother: The smoother, set up.

    Returns:
        That of the matrix after its preconditioner; 0 where nothing was estimated.

    Note:
        Collective.
    """
    estimate, found = ctypes.c_void_p(), ctypes.c_int()
    call("KSPChebyshevEstEigGetKSP", ctypes.c_void_p(smoother.handle), ctypes.byref(estimate))
    if not estimate:
        return 0.0
    real, imaginary = np.zeros(_MOST_VALUES), np.zeros(_MOST_VALUES)
    parts = (ctypes.c_void_p(part.ctypes.data) for part in (real, imaginary))
    call("KSPComputeEigenvalues", estimate, _MOST_VALUES, *parts, ctypes.byref(found))
    return float(real[: found.value].max(initial=0.0))


def set_own_preconditioner(solver: PETSc.KSP, preconditioner: Any) -> None:
    """Give a solver a preconditioner of ours; call it before options are set.

    The user's options under `PREFIX` are those of the body's preconditioner, which ours applies.

    Args:
        solver: The solver.
        preconditioner: Has ``apply``; keep it as long as the solver.
    """
    solver.pc.setOptionsPrefix(f"{PREFIX}contact_")
    solver.pc.setType("python")
    solver.pc.setPythonContext(WeakContext(preconditioner))


def reason_name(reasons: type, code: int) -> str:
    """Return the name of a PETSc converged reason, such as ``DIVERGED_LINE_SEARCH``.

    Args:
        reasons: PETSc's class of reasons.
        code: The number that a solver reports.
    """
    names = [name for name, value in vars(reasons).items() if value == code and name.isupper()]
    # short aliases such as MAX_IT exist; PETSc documents the longest name
    return max(names, key=len, default=f"reason {code}")


def weakly(method: Callable[..., T]) -> Callable[..., T]:
    """Return a call of an object's method for PETSc, which does not keep the object alive.

    A solver that held its owner would be freed by Python's search for cycles alone, at any moment,
    such as that in which PETSc forgets what was dropped; see `set_up`.

    Args:
        method: The bound method.
    """
    kept = weakref.WeakMethod(method)

    def call(*arguments: Any) -> T:
        bound = kept()
        if bound is None:
            raise ReferenceError("the owner of a PETSc solver is gone")
        return bound(*arguments)

    return call


class WeakContext:
    """The Python context of a PETSc matrix or preconditioner, which its owner must keep alive.

    PETSc holds this object and this object holds the real context weakly. A context that PETSc
    held itself would let go of its own matrices only while PETSc frees dropped objects
    (`macro.compat.collect_garbage`), and what is dropped during that is never freed.

    Args:
        context: Has ``mult`` or ``apply``, as petsc4py asks of contexts.
    """

    def __init__(self, context: Any) -> None:
        self._context = weakref.ref(context)

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write a matrix's product y with x."""
        self._owned.mult(matrix, x, y)

    def apply(self, preconditioner: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write a preconditioner's y for x."""
        self._owned.apply(preconditioner, x, y)

    @property
    def _owned(self) -> Any:
        context = self._context()
        if context is None:
            raise ReferenceError("the owner of a PETSc context is gone")
        return context


def shell(like: PETSc.Mat, context: Any) -> PETSc.Mat:
    """Return a PETSc matrix without entries whose products an object writes.

    Args:
        like: A matrix of the same sizes.
        context: Has ``mult``; keep it as long as the matrix.
    """
    matrix = PETSc.Mat().createPython(like.getSizes(), WeakContext(context), comm=like.comm)
    matrix.setUp()
    return matrix


def conjugate_gradients(operator: PETSc.Mat, matrix: PETSc.Mat, preconditioner: Any) -> PETSc.KSP:
    """Return conjugate gradients with a preconditioner of ours, whatever the user's options.

    Args:
        operator: The operator.
        matrix: The matrix that the preconditioner is made of.
        preconditioner: Has ``apply``; keep it as long as the solver. None: the matrix has diagonal
            blocks alone, which are inverted.
    """
    solver = PETSc.KSP().create(operator.comm)
    solver.setOperators(operator, matrix)
    solver.setType("cg")
    solver.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    solver.setTolerances(max_it=_MOST_ITERATIONS)
    solver.pc.setType("pbjacobi" if preconditioner is None else "python")
    if preconditioner is not None:
        solver.pc.setPythonContext(WeakContext(preconditioner))
    return solver
