"""Tables of the bond-associated law of what is here of a sheet."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..families import Families, InfluenceFunction
from ..families.cloud_share import made_by_share, share_families
from ..families.rows_here import rows_here
from ..interfaces.context import Context
from .weight_tables import plain_weights, weight_tables

Tables = tuple[Families, np.ndarray, np.ndarray, dict[str, float] | None]


class HasHorizon(Protocol):
    """A law with families."""

    @property
    def horizon(self) -> float:
        """Over the spacing of the sheet [-]."""
        ...

    @property
    def influence(self) -> str | InfluenceFunction:
        """Influence function."""
        ...


def law_tables(context: Context, law: HasHorizon, weights: str) -> Tables:
    """Families of what is here of the sheet, K^-1 and weights by row, and what a correction did.

    A process makes those of its own share alone where it can: plain weights of a cloud.

    Args:
        context: Knows the sheet and the share.
        law: The law.
        weights: "published", "plain" or "corrected".
    """
    share, crew = context.share, context.crew
    if share is not None and weights == "plain" and made_by_share(context.whole, share):
        families = share_families(context.whole, share, law.horizon, law.influence, crew.gather)
        inverse, size = families.inverse_shapes()
        return families, inverse, families.stiffened(plain_weights(families, size)), None
    families, inverse, found, correction = weight_tables(context.whole, law.horizon, law.influence, weights)
    found = families.stiffened(found)
    if share is None:
        return families, inverse, found, correction
    here = rows_here(families, share)
    return here.families, here.table(inverse), here.table(found), correction
