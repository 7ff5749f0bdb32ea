"""The rough surface itself, meshed and pressed: the model of references.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from patchlaw.geometry import Control, PatchGrid
from patchlaw.geometry.contact_state import ContactState, Spots, peaks_of
from patchlaw.multiscale.loading.load_step import LoadStep, PatchState
from patchlaw.multiscale.models.problem import Model
from patchlaw.multiscale.readable import ProgressObserver

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FaceEquilibrium, MeshQuality, UnilateralContactProblem


class RoughMesh(NamedTuple):
    """A body meshed with its roughness.

    Attributes:
        problem: Its contact problem.
        quality: How far the roughness has deformed its cells.
    """

    problem: UnilateralContactProblem
    quality: MeshQuality


class MeshedContact(Model):
    """Presses all meshes alike; load steps are those of the finest, with the others beside it.

    Args:
        meshes: The meshes, from coarse to fine.
        patches: What results are summed over.
        observe: Told of the meshes that are pressed.

    Attributes:
        meshes: The meshes.
    """

    on_mesh = True

    def __init__(
        self,
        meshes: Sequence[RoughMesh],
        patches: PatchGrid,
        observe: ProgressObserver | None = None,
    ) -> None:
        self.meshes, self._patches, self._observe = meshes, patches, observe
        self._last: tuple[FaceEquilibrium, ...] = ()

    @property
    def finest(self) -> UnilateralContactProblem:
        """The contact problem that the load steps are those of."""
        return self.meshes[-1].problem

    @property
    def latest(self) -> FaceEquilibrium | None:
        """The finest block at the latest load step; None before the first."""
        return self._last[-1] if self._last else None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step on every mesh; see `Model.press`."""
        states = []
        for done, one in enumerate(self.meshes, 1):
            states.append(one.problem.solve(control))
            if self._observe is not None:
                self._observe("meshes pressed", done, len(self.meshes))
        self._last = tuple(states)
        patches = self._patches
        finest, nominal = states[-1], patches.area * patches.count
        fractions = _area_share(finest) * finest.patch_area / patches.area
        return LoadStep.of_patches(
            patches,
            plane=(finest.approach, *finest.tilt),
            load=(finest.force, *finest.moment),
            patches=PatchState(finest.patch_closure, finest.patch_pressure, fractions),
            separation=finest.mean_separation,
            contacts=finest.contacts,
            newton_iterations=sum(state.iterations for state in states),
            linear_iterations=sum(state.linear_iterations for state in states),
            reason=finest.reason,
            imbalance=(finest.force - finest.reaction) / finest.force if finest.force else 0.0,
            peak_pressure_MPa=finest.peak_pressure,
            meshes=tuple(
                (state.approach, state.force, (state.contact_area or 0.0) / nominal)
                for state in states
            ),
        )

    def detail(self, latest: FaceEquilibrium) -> ContactState:
        """Return the spots and fields of a contact.

        The area of a spot is that of its nodes times the area with its border in the facets over
        that of all nodes, so that the areas of all spots add up to the load step's.
        """
        from patchlaw.macro import nodal_contact

        nodes = nodal_contact(self.finest, latest)
        touching = np.flatnonzero(nodes.region >= 0)
        region, count = nodes.region[touching], latest.contacts
        top = touching[peaks_of(region, nodes.pressure[touching], count)]
        some = nodes.area > 1e-9 * nodes.area.max()  # quadratic triangles: vertices have none
        spots = Spots(
            place=np.stack([nodes.x[top], nodes.y[top]], axis=1),
            area=_area_share(latest) * np.bincount(region, nodes.area[touching], minlength=count),
            force=np.bincount(region, nodes.force[touching], minlength=count).astype(np.float64),
            peak_pressure=nodes.pressure[top],
        )
        return ContactState(
            plane=latest.plane,
            patches=self._patches,
            force=latest.force,
            spots=spots,
            x=nodes.x[some],
            y=nodes.y[some],
            pressure=nodes.pressure[some],
            gap=nodes.gap[some],
        )

    def state(self) -> Any:
        """Return the plane on every mesh."""
        return tuple((state.approach, *state.tilt) for state in self._last)

    def restore(self, state: Any) -> None:
        """Press every mesh by its plane again."""
        self._last = tuple(
            one.problem.solve(Control(approach=approach, tilt=(tx, ty)))
            for one, (approach, tx, ty) in zip(self.meshes, state, strict=False)
        )

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Any:
        """Return the finest block at the latest load step."""
        return self.latest

    def field_record(self, state: Any) -> Any:
        """Return what the load step was found from; displacements are of one rank."""
        return self.state()

    def field_state_again(self, record: Any, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what fields are made from; see `Model.field_state_again`."""
        last = self.state()
        self.restore(record)
        found = self.field_state(step, parts)
        self.restore(last)
        return found

    def write_fields(self, path: Path, states: Mapping[int, Any]) -> None:
        """Write the fields of the finest rough block."""
        from patchlaw.macro import write_rough_fields

        write_rough_fields(path, self.finest, sorted(states.items()))

    @property
    def meshed_bodies(self) -> list[Any]:
        """The rough blocks, the finest last."""
        return [one.problem.body for one in self.meshes]

    @property
    def unknowns(self) -> int:
        """Degrees of freedom of the finest mesh."""
        return self.finest.body.dofs


def _area_share(state: FaceEquilibrium) -> float:
    """Return the contact area with its border in facets over that of whole nodes, as in patches."""
    return (state.contact_area or 0.0) / state.nodal_area if state.nodal_area else 0.0
