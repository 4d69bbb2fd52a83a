"""Types of the material factories that a law needs: precision in bits -> Warp functions."""

from collections.abc import Callable
from typing import Any, TypeAlias

import warp as wp

FunctionFactory: TypeAlias = Callable[[int], wp.Function]
PairFactory: TypeAlias = Callable[[int], tuple[wp.Function, wp.Function]]
PairwiseFactory: TypeAlias = Callable[[int], tuple[wp.Function, wp.Function, wp.Function]]


def constants_of(function: wp.Function) -> Any:
    """Type of the constants that a function of a material or of a law takes: `constants`, or the second argument."""
    types = function.input_types
    return types.get("constants", list(types.values())[1])
