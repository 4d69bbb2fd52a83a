"""Regions: indices of points that know which points they were selected from."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

# Functions of NumPy that give indices if they are given indices.
JOINING = frozenset(
    {np.concatenate, np.hstack, np.append, np.unique, np.union1d, np.intersect1d, np.setdiff1d, np.sort, np.ravel}
)


class Region(np.ndarray):
    """Point indices, int32, with the points they were selected from, to detect use with another sheet.

    Slicing, and joining with other regions of the same points, preserve the region. A plain array, such as
    `np.array(region)`, is never checked.

    Attributes:
        of: Positions of these points [m], shape (N, 2), or None.
    """

    of: Any

    def __array_finalize__(self, obj: Any) -> None:
        """Copy `of` to views and copies."""
        self.of = getattr(obj, "of", None)

    def __array_function__(
        self, func: Callable[..., Any], types: Iterable[type], args: Iterable[Any], kwargs: Any
    ) -> Any:
        """Return a plain array from NumPy functions, except when joining regions of the same points."""
        result = super().__array_function__(func, types, args, kwargs)
        if func not in JOINING or type(result) not in (np.ndarray, Region):
            return result
        given = _regions(args)
        same = all(region.of is given[0].of for region in given)
        return region_of(result, given[0].of) if given and same and given[0].of is not None else np.asarray(result)

    def fits(self, points: Any) -> bool:
        """Whether it was selected from these points, shape (N, 2), or from equal ones."""
        return self.of is None or self.of is points or bool(np.array_equal(self.of, points))


def region_of(indices: np.ndarray, points: Any) -> Region:
    """Make a region from indices of points, shape (N, 2)."""
    region = np.asarray(indices, np.int32).view(Region)
    region.of = points
    return region


def _regions(arguments: Iterable[Any]) -> list[Region]:
    given = [_regions(each) if isinstance(each, list | tuple) else [each] for each in arguments]
    return [each for some in given for each in some if isinstance(each, Region)]
