"""Output of simulations and results in notebooks: tables, and the page of a run."""

from __future__ import annotations

import html
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from typing import Any

from ..device.checks import InputError

Rows = Sequence[tuple[str, str]]


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    kernel = sys.modules.get("IPython")
    shell = kernel.get_ipython() if kernel is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def has_widgets() -> bool:
    """Whether the notebook can show a progress bar."""
    return find_spec("ipywidgets") is not None


def text_table(title: str, rows: Rows) -> str:
    """Text table of names and values below a title."""
    width = max((len(name) for name, _ in rows), default=0)
    return "\n".join([title, *(f"  {name:{width}s}  {value}" for name, value in rows)])


def html_table(title: str, rows: Rows) -> str:
    """HTML table of names and values below a title."""
    cells = "".join(
        f'<tr><th style="text-align:left">{html.escape(name)}</th>'
        f'<td style="text-align:left">{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f"<table><caption>{html.escape(title)}</caption>{cells}</table>"


def data_frame(history: Sequence[Mapping[str, float]]) -> Any:
    """The history as a `pandas.DataFrame`, one row per frame. Raises InputError if pandas is not installed."""
    try:
        import pandas  # type: ignore[import-untyped, import-not-found, unused-ignore]
    except ImportError:
        raise InputError(
            "table: expected pandas to be installed (pip install pandas); `history` works without it"
        ) from None
    return pandas.DataFrame([dict(row) for row in history])


class Page:
    """An HTML page shown in a frame of a notebook.

    Attributes:
        source: Its HTML, complete.
        height: Height of the frame [pixels].
    """

    def __init__(self, source: str, height: int) -> None:
        self.source, self.height = source, height

    def _repr_html_(self) -> str:
        """The page in an isolated iframe."""
        return (
            f'<iframe srcdoc="{html.escape(self.source)}" width="100%" height="{self.height}" '
            'style="border:0" allowfullscreen></iframe>'
        )

    def __repr__(self) -> str:
        """One line."""
        return f"Page({len(self.source) / 1e6:.3g} MB; a notebook shows it)"
