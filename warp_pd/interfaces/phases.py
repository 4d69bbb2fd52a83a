"""The phases of a step, in order.

Parts add launches to phases (`BuiltPart.add`). Within a phase they run in the order of the parts: force law, solver,
prescribed motion, clock, rigid inclusions, supports and loads as the scene lists them, contact, rupture, the sum of all
loads, checks at frames. Features a scene does not use add no launch.
"""

from __future__ import annotations

import enum


class Phase(enum.Enum):
    """When in a step a launch runs; the value describes the phase."""

    PRESCRIBE = "velocity of points on a prescribed motion"
    RIGID_DRIFT = "half kick and drift of rigid inclusions"
    DRIFT = "half kick and drift of the points"
    PROJECT = "contact: points out of bodies"
    CLOCK = "time, and the schedules that depend on it"
    RUPTURE = "bonds that exceed the criterion break"
    INTERNAL_VARIABLES = "internal variables of the force law"
    INTERNAL_FORCE = "internal force"
    BOND_WORK = "work of each bond"
    EXTERNAL_FORCE = "external force"
    DAMPING = "damping of this step"
    KICK = "second half kick of the points"
    RIGID_KICK = "second half kick of rigid inclusions"
    SEPARATE = "contact: velocity into bodies"

    # Outside the step.
    START = "state of the force law at the initial displacement"
    RESTORE = "what follows from the arrays of a restart file"
    SCHEDULES = "schedules at the present time"
    FRAME = "what frames and the history hold"


STEP = (
    Phase.PRESCRIBE,
    Phase.RIGID_DRIFT,
    Phase.DRIFT,
    Phase.PROJECT,
    Phase.CLOCK,
    Phase.RUPTURE,
    Phase.INTERNAL_VARIABLES,
    Phase.INTERNAL_FORCE,
    Phase.BOND_WORK,
    Phase.EXTERNAL_FORCE,
    Phase.DAMPING,
    Phase.KICK,
    Phase.RIGID_KICK,
    Phase.SEPARATE,
)
# Forces that belong to the displacement, before the first step or after a restart.
SETUP = (Phase.RESTORE, Phase.SCHEDULES, Phase.INTERNAL_FORCE, Phase.EXTERNAL_FORCE)
