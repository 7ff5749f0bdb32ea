"""Parts of a contact face that each have a law of their own: `Regions`."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

from support.errors import InputError


@dataclass(frozen=True, slots=True)
class Regions:
    """Named parts of a face of any outline; what `PatchGrid` is to the patches of a rectangle.

    Args:
        names: Their names, in the order of their laws. A face in one piece is one region.

    Raises:
        InputError: When there is no name, an empty one, or one twice.
    """

    names: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        if not self.names or not all(self.names) or len(set(self.names)) < len(self.names):
            raise InputError(
                "the regions of a face need names",
                value=list(self.names),
                allowed="one name or more, each once",
            )

    @property
    def count(self) -> int:
        """Number of regions N."""
        return len(self.names)

    def index(self, name: str) -> int:
        """Return the index of a region, and so of its law.

        Args:
            name: Its name.

        Raises:
            InputError: When there is no such region.
        """
        if name not in self.names:
            nearest = get_close_matches(name, self.names, n=1, cutoff=0.0)[0]
            allowed = f"{', '.join(self.names)} (nearest: {nearest})"
            raise InputError("there is no such region", value=name, allowed=allowed)
        return self.names.index(name)
