"""Types of the factories that a law needs from its material: precision in bits -> Warp functions."""

from collections.abc import Callable
from typing import TypeAlias

import warp as wp

FunctionFactory: TypeAlias = Callable[[int], wp.Function]
PairFactory: TypeAlias = Callable[[int], tuple[wp.Function, wp.Function]]
PairwiseFactory: TypeAlias = Callable[[int], tuple[wp.Function, wp.Function, wp.Function]]
