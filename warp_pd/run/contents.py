"""What the files of a run hold: which formats, and which point fields of frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..device.checks import InputError
from ..laws.point_fields import GROUPS
from .built import Built


@dataclass(frozen=True)
class Files:
    """What a run writes besides history, summary and restart files.

    Attributes:
        usd: Whether to write animation.usd.
        vtkhdf: Whether to write frames.vtkhdf.
        pictures: Formats of the pictures; empty for none.
        view: Whether to write view.html.
        restarts: Whether to write restart files.
    """

    usd: bool = True
    vtkhdf: bool = True
    pictures: tuple[str, ...] = ()
    view: bool = True
    restarts: bool = True

    def require_same(self, folder: Path) -> None:
        """Refuse to resume with other files than the run began with: they would hold a part of it and look whole.

        Args:
            folder: The folder.

        Raises:
            InputError: for a file that is there and should not be, or the other way.
        """
        for name, option, wanted in (("animation.usd", "usd", self.usd), ("frames.vtkhdf", "vtkhdf", self.vtkhdf)):
            begun = (folder / name).is_file()
            # Frames that are gone are told by their writer.
            if begun != wanted and (begun or name != "frames.vtkhdf"):
                there = "holds" if begun else "lacks"
                expected = f"{option} = {begun}, {'without ' if begun else ''}--no-{option}"
                raise InputError(f"resume in {str(folder)!r}: it {there} {name}; expected {expected}, as it began")


def held_fields(built: Built) -> frozenset[str] | None:
    """Names of the point fields that files hold besides the displacement; None: all of a frame.

    Raises:
        InputError: for a name that the frames of this scene do not have.
    """
    scene = built.simulation
    there = [stored.field.output for stored in built.context.fields.shown()]
    if built.rupture is not None:
        there.append("damage")
    asked = [*scene.fields, *(scene.chosen_fields or ())]
    for name in asked:
        if name not in there and name not in GROUPS:
            known = ", ".join(sorted({*there, *built.law.field_names()}))
            raise InputError(f"fields = {name!r}: the frames of this scene have none; expected one of {known}")
    return None if scene.chosen_fields is None else frozenset(arrays_of(asked))


def arrays_of(names: Sequence[str]) -> list[str]:
    """Names of the arrays that names stand for: "stretch" for "stretch_1" and "stretch_2"."""
    return [array for name in names for array in GROUPS.get(name, (name,))]
