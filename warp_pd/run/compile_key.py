"""Name of the Warp module of a simulation: scenes that need the same kernels use the same module."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import Any

from ..interfaces import Part
from ..interfaces.context import Features, layout_of
from .scene import Scene


def module_name(scene: Scene, parts: Sequence[Part], features: Features, bits: int) -> str:
    """One Warp module per configuration, named by everything that decides its kernels."""
    law = (*_name(type(scene.force)), *scene.force.compile_key(layout_of(scene.sheet), features.breakable))
    named = sorted({repr(_named((*_name(type(part)), *part.compile_key()))) for part in parts})
    stretched = [] if scene.sheet.stretch is None else ["prestretched"]
    key = (bits, features, *_name(type(scene.solver)), _named(law), named, *stretched)
    return "warp_pd_" + hashlib.sha1(repr(key).encode()).hexdigest()[:12]


def _name(kind: type | Callable[..., Any]) -> tuple[str, str]:
    return kind.__module__, kind.__qualname__


def _named(key: tuple[object, ...]) -> list[object]:
    """The key with functions replaced by their names, so that its text is the same in every process."""
    return [".".join(_name(entry)) if callable(entry) else entry for entry in key]
