"""Running a scene: recorder, energy balance, restart, summary.

Subjects add to the lists below when they are imported, which the package does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..communicator import Communicator
    from ..interfaces import Part
    from .scene import Scene

# Parts of a scene that its arguments do not name, such as the rigid inclusions of its sheet.
PARTS: list[Callable[[Scene], Sequence[Part]]] = []
# The communicator of this process and its device, if it is one of several; None otherwise.
COMMUNICATORS: list[Callable[[str | None], tuple[Communicator, str | None] | None]] = []
# What draws and shows runs and sheets, `PagesAndPictures` of viewer/__init__.py; of several the last one.
VIEWERS: list[Any] = []
