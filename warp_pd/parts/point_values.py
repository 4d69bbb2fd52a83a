"""Values of the points that a material takes as its last constant, changed in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..context import Context
from ..device.checks import InputError
from ..device.fields import to_host
from ..device.launches import Stage
from ..device.schedules import factor_schedule
from ..interfaces import BuiltLaw, BuiltPart, Part
from ..kernels.loads import scaled_values
from ..step import Phase
from .loads import Ramp


@dataclass(frozen=True)
class ValuesInTime(Part):
    """Multiplies the values by point of the material (`Material.by_point`) by a factor in time, such as a temperature.

    Their change does work that nothing counts, so there is no energy balance.

    Attributes:
        ramp: Pairs (time [s], factor).
    """

    ramp: Ramp
    unbalanced: ClassVar[bool] = True

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Build the factor on a device."""
        schedule = factor_schedule("ValuesInTime", self.ramp)
        if schedule is None:
            raise InputError("ValuesInTime.ramp = None: expected pairs (time, factor)")
        if law.point_values is None:
            raise InputError("loads: ValuesInTime: expected a material with values by point (`by_point`)")
        return ScaledValues(context, law, context.clock.register(schedule))


class ScaledValues(BuiltPart):
    """The values on a device."""

    label = "loads: ValuesInTime"

    def __init__(self, context: Context, law: BuiltLaw, schedule: int | None) -> None:
        assert law.point_values is not None
        self.context, self.values, self.schedule = context, law.point_values, schedule
        given = to_host(self.values)
        self.unit = context.array("unit_values", "ValuesInTime", context.types.real, given)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch that sets the values when the schedules change."""
        if phase in (Phase.SCHEDULES, Phase.CLOCK):
            context = self.context
            stage.launch(
                "ValuesInTime", scaled_values(context.bits), context.sheet.size, unit=self.unit,
                factors=context.clock.scheduled, schedule=self.schedule, values=self.values,
            )  # fmt: skip
