"""The code that computes a run: version and hash of the package, version of Warp, git commit."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

import warp as wp

from ..device.version import __version__
from ..kernels import numeric

PACKAGE = Path(__file__).parents[1]


@functools.cache
def code_version() -> str:
    """Text such as "warp-pd 1.0.0 3f2a91c07b4e, Warp 1.19.0"; the hash is that of the package and its kernels.

    Scenes are left out: their own hash is compared.
    """
    text = hashlib.sha1()
    for folder in (PACKAGE, Path(numeric.__file__).parent):
        for file in sorted(folder.rglob("*.py")):
            name = file.relative_to(folder).as_posix()
            if not name.startswith(("scenes/", "kernels/")):
                text.update(f"{name}\n".encode() + file.read_bytes().replace(b"\r\n", b"\n"))
    return f"warp-pd {__version__} {text.hexdigest()[:12]}, Warp {wp.config.version}"


def commit_of(checkout: Path) -> str | None:
    """The git commit of a checkout, which may be a worktree of another one; None for another folder."""
    git = common = checkout / ".git"
    try:
        if git.is_file():
            git = checkout / _text(git).removeprefix("gitdir:").strip()
            common = git / _text(git / "commondir")
        head = _text(git / "HEAD")
        name = head.removeprefix("ref: ")
        if name == head:
            return head
        loose = common / name
        if loose.is_file():
            return _text(loose)
        packed = _text(common / "packed-refs").splitlines()
        return next((line.split()[0] for line in packed if line.endswith(f" {name}")), None)
    except OSError:
        return None


def _text(path: Path) -> str:
    return path.read_text("utf-8").strip()
