"""Membrane finite elements on scikit-fem: tools/finite_elements.py, as a user of it would write them."""

from __future__ import annotations

import numpy as np
import skfem

from peers.elements import rubber, solved


def solve(problem, settings):
    """Settings: points, nodes (of an element, 4 or 9; 4 in time)."""
    sheet = solved(problem, settings["points"], rubber(problem), settings["nodes"] == 9)
    moved = np.zeros((len(sheet.nodes), 3))
    moved[:, : sheet.components] = sheet.displacement
    return {"places": sheet.nodes, "displacement": moved, "told": {"version": f"scikit-fem {skfem.__version__}"}}
