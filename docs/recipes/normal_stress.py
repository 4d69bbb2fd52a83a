"""A dead stress across the sheet, by point: a load that follows the load factor."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from warp_pd.device.checks import numbers
from warp_pd.interfaces import Load
from warp_pd.parts.loads import DeadLoad


@dataclass(frozen=True, eq=False)
class NormalStress(Load):
    """A dead stress along z of every point, `values` [Pa], shape (N,); `ramp`: pairs (time [s], factor), or None."""

    values: Any
    ramp: Any = None

    def __post_init__(self):
        numbers("NormalStress.values", self.values)

    def build(self, context, law):
        force = np.outer(self.values * context.areas, (0.0, 0.0, 1.0))
        return DeadLoad("NormalStress", context, np.arange(context.sheet.size, dtype=np.int32), force, self.ramp)
