"""The contacts of load steps: a row for every spot, and maps of pressure and gap."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from patchlaw.geometry.contact_state import ContactState
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.support import Array, Flags, InputError, check_fields, checked
from patchlaw.support.packages import by_matplotlib
from patchlaw.support.readable import (
    Displayed,
    Table,
    column,
    counted,
    data_frame,
    dataset,
    measured,
    number,
    of_columns,
    spread,
    usual,
    usual_unit,
)

SPOT_COLUMNS = ("x_mm", "y_mm", "area_mm2", "force_N", "peak_pressure_MPa")
"""Columns of ``contacts.csv`` behind the load step and the number of the spot."""

_OF_CONTACT = {
    "x_mm": "x", "y_mm": "y", "pressure_MPa": "pressure", "gap_mm": "gap",
    "plastic_depth_mm": "plastic_depth", "worn_depth_mm": "worn_depth",
    "dissipated_mJ_per_mm2": "heat",
}  # fmt: skip
_OF_SHEAR = {"traction_MPa": "traction", "slip_mm": "slip", "slipping": "slipping"}
"""Attributes of `ContactState` and of `ShearState` by the names that records and files have."""
FIELDS = (*_OF_CONTACT, *_OF_SHEAR)
"""Datasets of a load step in ``contact.h5``; plastic depth under a hardness and worn depth with
wear alone, what follows them with friction."""

_NEEDED = {
    "plastic_depth_mm": "a hardness", "worn_depth_mm": "wear", "dissipated_mJ_per_mm2": "friction",
}  # fmt: skip
_MOST = 0.99
"""Share of the loaded cells within the scale of pressures: few cells carry the largest ones."""


class ContactScales(NamedTuple):
    """Ends of the colour scales that maps of contacts share; 0 where there is nothing to show.

    Attributes:
        pressure: Of contact pressures [MPa].
        gap: Of gaps outside the contact [mm].
        depth: Of plastic depths [mm].
        spot: Of the largest pressures of spots [MPa].
    """

    pressure: float
    gap: float
    depth: float
    spot: float

    @property
    def pressure_unit(self) -> tuple[str, float]:
        """The unit of all pressures in a figure, and its size: that which suits the largest."""
        return usual_unit([self.pressure, self.spot], "MPa")

    @classmethod
    def of(cls, records: Iterable[ContactRecord]) -> ContactScales:
        """Return scales that suit all of some contacts.

        Args:
            records: The contacts.
        """
        return cls(*np.max([(0.0,) * 4, *(record.scales for record in records)], axis=0).tolist())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ContactRecord(Displayed):
    """The contact of all m spots at one load step, the largest force first.

    Attributes:
        step: Number of the load step.
        approach_mm: Approach of the plane [mm].
        force_N: Force of all spots [N].
        unloading: Whether the load fell to this load step.
        lengths_mm: Sides of the surface [mm].
        spots: A row for each spot, see `SPOT_COLUMNS`: the place of its largest pressure, its real
            contact area, its force and that pressure, shape (m, 5).
        x_mm: Abscissae of the nx × ny cells, shape (nx,), or of the n nodes of a reference, shape
            (n,) [mm]; None where only the spots are known.
        y_mm: Their ordinates, shape (ny,) or (n,) [mm].
        pressure_MPa: Contact pressures, shape (nx, ny) or (n,) [MPa].
        gap_mm: Gaps between the plane and the deformed surface, shape (nx, ny) or (n,) [mm].
        plastic_depth_mm: Plastic depth that the loads so far left, by which the heights are lower,
            shape (nx, ny) [mm]; None without a hardness.
        worn_depth_mm: Depth that has worn off, shape (nx, ny) [mm]; None without wear.
        dissipated_mJ_per_mm2: Energy lost to friction so far per area, shape (nx, ny) [mJ/mm²];
            None without friction.
        traction_MPa: Tractions along x and y, shape (2, nx, ny) [MPa]; None without friction, as
            the next two.
        slip_mm: Slip of the cells in contact since they touched, shape (2, nx, ny) [mm].
        slipping: Which cells in contact bear the traction μ p, shape (nx, ny).
    """

    step: int
    approach_mm: float
    force_N: float
    lengths_mm: tuple[float, float]
    spots: Array
    x_mm: Array | None = None
    y_mm: Array | None = None
    pressure_MPa: Array | None = None
    gap_mm: Array | None = None
    plastic_depth_mm: Array | None = None
    worn_depth_mm: Array | None = None
    dissipated_mJ_per_mm2: Array | None = None
    traction_MPa: Array | None = None
    slip_mm: Array | None = None
    slipping: Flags | None = None
    unloading: bool = False

    @classmethod
    def of(
        cls,
        state: ContactState,
        step: LoadStep,
        lengths: tuple[float, float],
        *,
        unloading: bool = False,
    ) -> ContactRecord:
        """Return the record of a load step.

        Args:
            state: The contact, with its spots.
            step: The load step.
            lengths: Sides of the surface [mm].
            unloading: Whether the load fell to it.
        """
        assert state.spots is not None
        found = state.spots
        spots = np.column_stack([found.place, found.area, found.force, found.peak_pressure])
        order = np.lexsort((spots[:, 1], spots[:, 0], -spots[:, 3]))
        maps = {name: getattr(state, attribute) for name, attribute in _OF_CONTACT.items()}
        maps |= {name: getattr(state.shear, one, None) for name, one in _OF_SHEAR.items()}
        return cls(
            step=step.step,
            approach_mm=step.approach_mm,
            force_N=float(found.force.sum()),
            lengths_mm=(float(lengths[0]), float(lengths[1])),
            spots=np.ascontiguousarray(spots[order]),
            unloading=unloading,
            **maps,
        )

    @property
    def place_mm(self) -> Array:
        """Place of the largest pressure of each spot, shape (m, 2) [mm]."""
        return self.spots[:, :2]

    @property
    def area_mm2(self) -> Array:
        """Real contact area of each spot, shape (m,) [mm²]."""
        return self.spots[:, 2]

    @property
    def spot_force_N(self) -> Array:
        """Force of each spot, shape (m,) [N]."""
        return self.spots[:, 3]

    @property
    def peak_pressure_MPa(self) -> Array:
        """Largest pressure of each spot, shape (m,) [MPa]."""
        return self.spots[:, 4]

    @property
    def title(self) -> str:
        """What the contact is of, as figures say it."""
        falls = ", unloading" * self.unloading
        spots = counted(len(self.spots), "spot") if self.force_N > 0.0 else "no contact"
        load = f"approach {usual(self.approach_mm, 'mm')}, force {usual(self.force_N, 'N')}"
        return f"load step {self.step}{falls}: {load}, {spots}"

    @property
    def scales(self) -> ContactScales:
        """Ends of the colour scales that suit this contact."""
        pressure = gap = 0.0
        if self.pressure_MPa is not None and self.gap_mm is not None:
            loaded = self.pressure_MPa > 0.0
            gap = self.gap_mm[~loaded].max(initial=0.0)
            pressure = np.quantile(self.pressure_MPa[loaded], _MOST) if loaded.any() else 0.0
        depth = 0.0 if self.plastic_depth_mm is None else self.plastic_depth_mm.max(initial=0.0)
        return ContactScales(pressure, gap, depth, self.peak_pressure_MPa.max(initial=0.0))

    def rows(self) -> Iterator[tuple]:
        """Yield the rows of ``contacts.csv``."""
        for place, spot in enumerate(self.spots.tolist(), 1):
            yield (self.step, place, *spot)

    def displayed(self) -> tuple[str, Table]:
        """Return what this is in a line, and a table of the spots that carry most."""
        count, most = len(self.spots), self.spots[:20]
        line = (
            f"ContactRecord of load step {self.step}: {count} spot{'s' * (count != 1)} at "
            f"{measured(self.approach_mm, None, 'mm')}, {measured(self.force_N, None, 'N')}"
            f"{f'; the {len(most)} that carry most' if len(most) < count else ''}"
        )
        x, y, area, force, peak = most.T
        return line, of_columns(
            ["spot", *map(str, range(1, len(most) + 1))],
            ["x [mm]", *(number(one, 4) for one in x)],
            ["y [mm]", *(number(one, 4) for one in y)],
            column("area", area, "mm²"),
            column("force", force, "N"),
            column("peak pressure", peak, "MPa"),
        )

    def plot(self) -> Any:
        """Draw pressures, gaps, plastic depths and the sizes of the spots.

        Returns:
            A matplotlib figure; a notebook shows it.
        """
        return by_matplotlib("multiscale.results.figures.contact.contact_figure", self)


_MAPS = FIELDS[2:]


_OF_STEPS = {"step": np.int64, "approach_mm": float, "force_N": float, "unloading": bool}
"""Numbers of a contact, and their kinds in arrays."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ContactHistory(Displayed, Sequence[ContactRecord]):
    """The contacts of n load steps, one record each; arrays have the load steps as first axis.

    An index gives a record, a slice the contacts of these load steps alone. Fields of the records
    are attributes: ``force_N`` has shape (n,), as have ``step``, ``approach_mm`` and ``unloading``;
    maps such as ``pressure_MPa`` have shape (n, nx, ny), or (n, nodes) of a reference. The places
    ``x_mm`` and ``y_mm``, which all load steps have in common, have shape (nx,) and (ny,), or those
    of the nodes.

    Attributes:
        records: The contacts, by load step.
    """

    records: tuple[ContactRecord, ...]

    def __getattr__(self, name: str) -> Array:
        if name in _OF_STEPS:
            return np.array([getattr(one, name) for one in self.records], _OF_STEPS[name])
        if name not in FIELDS:
            raise AttributeError(f"'ContactHistory' object has no attribute {name!r}")
        found = self.of_records(name)
        return found if name in _MAPS else found[0]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *_OF_STEPS, *FIELDS]

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    def __len__(self) -> int:
        return len(self.records)

    def __getitem__(self, index: Any) -> Any:
        found = self.records[index]
        return ContactHistory(records=found) if isinstance(index, slice) else found

    @checked
    def at(self, step: int) -> ContactRecord:
        """Return the contact of a load step.

        Args:
            step: Number of the load step, from 1.

        Raises:
            InputError: When the contact of this load step was not recorded.
        """
        for record in self.records:
            if record.step == step:
                return record
        recorded = ", ".join(str(record.step) for record in self.records)
        raise InputError(
            "is no load step whose contact was recorded",
            key="step",
            value=step,
            allowed=f"{recorded}; any of a run with output.contact = 'all'",
        )

    @property
    def spots(self) -> tuple[Array, ...]:
        """The spots of each load step, the largest force first; see `ContactRecord.spots`."""
        return tuple(record.spots for record in self.records)

    @checked
    def has(self, name: str) -> bool:
        """Tell whether all contacts have a map.

        Args:
            name: Its name, such as ``"plastic_depth_mm"``.
        """
        return bool(self.records) and all(getattr(one, name) is not None for one in self.records)

    @checked
    def of_records(self, name: str) -> Array:
        """Return a map of all contacts, which are all of the same points.

        Args:
            name: Name of the map.

        Raises:
            InputError: When a contact is without it.
        """
        if not self.has(name):
            needed = _NEEDED.get(name, "a model with cells or nodes")
            raise InputError("is not known of these contacts", key=name, allowed=f"with {needed}")
        return np.stack([getattr(record, name) for record in self.records])

    def records_of_spots(self) -> list[dict[str, Any]]:
        """Return the rows of ``contacts.csv``, each as a dictionary by column."""
        columns = ("step", "spot", *SPOT_COLUMNS)
        rows = (row for record in self.records for row in record.rows())
        return [dict(zip(columns, row, strict=True)) for row in rows]

    def to_dataframe(self) -> Any:
        """Return the rows of ``contacts.csv`` as a pandas data frame.

        Raises:
            ImportError: When pandas, which patchlaw does not require, is not installed.
        """
        return data_frame(self.records_of_spots())

    def to_xarray(self) -> Any:
        """Return maps, loads and spots as an xarray dataset; units end the names.

        Maps have the dimensions ``step``, ``x`` and ``y``, of a reference ``step`` and ``node``.
        Spots have the dimension ``spot``, and ``spot_step`` says of which load step each is.

        Raises:
            ImportError: When xarray, which patchlaw does not require, is not installed.
        """
        names = tuple(f"spot_{name}" for name in SPOT_COLUMNS)
        rows = np.concatenate([np.zeros((0, len(names))), *self.spots])
        owner = np.repeat(self.step, [len(spots) for spots in self.spots])
        columns = zip(names, rows.T, strict=True)
        values: dict[str, Any] = {name: (("spot",), column) for name, column in columns}
        coordinates: dict[str, Any] = {"step": self.step, "spot_step": (("spot",), owner)}
        coordinates |= {name: (("step",), getattr(self, name)) for name in [*_OF_STEPS][1:]}
        maps = [name for name in _MAPS if self.has(name)]
        if maps:
            on_cells = getattr(self, maps[0]).ndim == 3
            axes = ("x", "y") if on_cells else ("node", "node")
            coordinates |= {"x_mm": ((axes[0],), self.x_mm), "y_mm": ((axes[1],), self.y_mm)}
            dimensions = ("step", *dict.fromkeys(axes))
            values |= {name: (dimensions, getattr(self, name)) for name in maps}
        return dataset(values, coordinates, {"units": "mm, N, MPa"})

    def displayed(self) -> tuple[str, Table]:
        """Return what this is in a line, and a table of the load steps."""
        shown = [self.records[place] for place in spread(len(self), 60)]
        peaks = [float(one.peak_pressure_MPa.max(initial=0.0)) for one in shown]
        table = of_columns(
            ["step", *(str(one.step) for one in shown)],
            column("approach", (one.approach_mm for one in shown), "mm"),
            column("force", (one.force_N for one in shown), "N"),
            ["spots", *(str(len(one.spots)) for one in shown)],
            column("peak pressure", peaks, "MPa"),
        )
        maps = [name for name in _MAPS if self.has(name)]
        of = f"; maps: {', '.join(maps)}" if maps else ""
        return f"ContactHistory of {len(self)} load step{'s' * (len(self) != 1)}{of}", table

    @checked
    def plot(self, step: int) -> Any:
        """Draw the contact of a load step; all load steps have the same colour scales.

        Args:
            step: Number of the load step.

        Returns:
            A matplotlib figure; a notebook shows it.

        Raises:
            InputError: When the contact of this load step was not recorded.
        """
        drawn, scales = self.at(step), ContactScales.of(self.records)
        return by_matplotlib("multiscale.results.figures.contact.contact_figure", drawn, scales)


_MOST_CONTACTS = 40
"""Contacts that a report shows at most, each with a picture of some 100 kB."""


def shown_contacts(contacts: Sequence[ContactRecord]) -> list[ContactRecord]:
    """Return the contacts that a report shows: all of up to 40, else as many at equal distances.

    The first, the last and that of the largest force are among them. A single contact has a
    figure of its own.

    Args:
        contacts: The contacts of the load steps.
    """
    count = len(contacts)
    if count <= _MOST_CONTACTS:
        return list(contacts) if count > 1 else []
    most = max(range(count), key=lambda index: contacts[index].force_N)
    chosen = {most, *np.linspace(0, count - 1, _MOST_CONTACTS - 1).round().astype(int).tolist()}
    return [contacts[index] for index in sorted(chosen)]
