"""The order of a step: what a simulation computes, from one displacement to the next.

Each line of these functions is a phase: every part of the scene that acts in it adds its launches there, in the order
in which run/built.py lists the parts: force law, solver, moved points, clock, rigid inclusions, supports and loads as
the scene names them, contact, rupture, the sum of all loads, checks at frames. A feature that the scene does not use
adds nothing. `warp-pd plan SCENE` prints the launches.

Within `one_launch`, pointwise stages on the same points share a launch; none of them may gather from neighbours what
another writes. With `and_next`, a GPU runs the end of a step and the beginning of the next in one launch, too. Bodies
on paths then move before it, and the contact that ends a step takes their positions of that step. A load that gathers
the displacement, such as a follower pressure, keeps steps apart.
"""

from __future__ import annotations

import enum
from typing import Protocol

from .device.launches import Stage


class Phase(enum.Enum):
    """What a part may add to; the value says what happens there."""

    FOLLOW = "rigid bodies follow their paths"
    PRESCRIBE = "velocity of points on a prescribed motion"
    RIGID_DRIFT = "half kick and drift of rigid inclusions"
    DRIFT = "half kick and drift of the points"
    PROJECT = "contact: points out of bodies"
    CLOCK = "time, and the schedules that depend on it"
    RUPTURE = "bonds that exceed the criterion break"
    UNDAMAGED_FORCE = "internal force of undamaged families, by a law that has a kernel of their own"
    SEVERING = "bonds break by a damage field that was found beside this force"
    INTERNAL_VARIABLES = "internal variables of the force law"
    INTERNAL_FORCE = "internal force, apart from that of undamaged families"
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


# Phases without a place in relaxation, and in Newton's method, which takes the forces alone and sets prescribed
# components itself. Both break bonds in equilibrium, in stages of their own.
NOT_IN_RELAXATION = (
    Phase.FOLLOW, Phase.PROJECT, Phase.SEVERING, Phase.INTERNAL_VARIABLES, Phase.BOND_WORK, Phase.SEPARATE,
)  # fmt: skip
NOT_IN_EQUILIBRIUM = (*NOT_IN_RELAXATION, Phase.RIGID_DRIFT, Phase.RIGID_KICK)


class Acting(Protocol):
    """The parts of a simulation, see `interfaces.System`."""

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of all parts in a phase."""
        ...


def begin(parts: Acting, stage: Stage) -> None:
    """Forces at the displacement, before the first step or after a restart, which then restores its own."""
    parts.add(Phase.RESTORE, stage)
    parts.add(Phase.SCHEDULES, stage)
    parts.add(Phase.UNDAMAGED_FORCE, stage)
    with stage.one_launch():
        parts.add(Phase.INTERNAL_FORCE, stage)
        parts.add(Phase.EXTERNAL_FORCE, stage)


def explicit_step(parts: Acting, step: Stage) -> None:
    """Central differences in time. A step ends with the forces at its displacement and the velocity at its end."""
    with step.leads():
        parts.add(Phase.FOLLOW, step)
    with step.one_launch():
        parts.add(Phase.PRESCRIBE, step)
        parts.add(Phase.RIGID_DRIFT, step)
        parts.add(Phase.DRIFT, step)
        parts.add(Phase.PROJECT, step)
    parts.add(Phase.CLOCK, step)
    parts.add(Phase.RUPTURE, step)
    parts.add(Phase.UNDAMAGED_FORCE, step)
    parts.add(Phase.SEVERING, step)
    parts.add(Phase.INTERNAL_VARIABLES, step)
    with step.one_launch(and_next=True):
        parts.add(Phase.INTERNAL_FORCE, step)
        parts.add(Phase.BOND_WORK, step)
        parts.add(Phase.EXTERNAL_FORCE, step)
        parts.add(Phase.DAMPING, step)
        parts.add(Phase.KICK, step)
        parts.add(Phase.RIGID_KICK, step)
        parts.add(Phase.SEPARATE, step)


def relaxation_step(parts: Acting, step: Stage) -> None:
    """Steps in fictitious time towards equilibrium, with the damping of the motion so far."""
    with step.one_launch():
        parts.add(Phase.PRESCRIBE, step)
        parts.add(Phase.RIGID_DRIFT, step)
        parts.add(Phase.DRIFT, step)
    parts.add(Phase.CLOCK, step)
    parts.add(Phase.UNDAMAGED_FORCE, step)
    with step.one_launch(and_next=True):
        parts.add(Phase.INTERNAL_FORCE, step)
        parts.add(Phase.EXTERNAL_FORCE, step)
        parts.add(Phase.DAMPING, step)
        parts.add(Phase.KICK, step)
        parts.add(Phase.RIGID_KICK, step)
