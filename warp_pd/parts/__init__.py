"""The parts of a scene: supports, loads, contact, rupture. Each file has the user's class and its built counterpart."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .bodies import RigidBody
    from .body_mesh import TriangleMesh
    from .body_motion import BodyPath, Free
    from .body_shapes import Box, Capsule, Cylinder, Plane, Sphere
    from .boundary_force import BoundaryForce
    from .contact import RigidBall, RigidContact
    from .enclosed import BuiltEnclosed, Enclosed, EnclosedGas, EnclosedVolume
    from .joint import Joint
    from .loads import BodyForce, PointForce, Pressure
    from .newton_world import newton_bodies
    from .point_values import ValuesInTime
    from .reaction import Reaction
    from .rupture import BondCriterion, CriticalEnergy, CriticalStretch
    from .scene_rupture import horizon_for_tears, length_for_tears, notes_on_criterion, stretch_or_energy
    from .self_contact import SelfContact
    from .supports import Fixed, Motion, stretching_edges
    from .tearing_energy import TearingEnergy
else:
    __getattr__ = lazy(
        __name__,
        {
            "bodies": "RigidBody",
            "body_mesh": "TriangleMesh",
            "body_motion": "BodyPath Free",
            "body_shapes": "Box Capsule Cylinder Plane Sphere",
            "boundary_force": "BoundaryForce",
            "contact": "RigidBall RigidContact",
            "enclosed": "BuiltEnclosed Enclosed EnclosedGas EnclosedVolume",
            "joint": "Joint",
            "loads": "BodyForce PointForce Pressure",
            "newton_world": "newton_bodies",
            "point_values": "ValuesInTime",
            "reaction": "Reaction",
            "rupture": "BondCriterion CriticalEnergy CriticalStretch",
            "scene_rupture": "horizon_for_tears length_for_tears notes_on_criterion stretch_or_energy",
            "self_contact": "SelfContact",
            "supports": "Fixed Motion stretching_edges",
            "tearing_energy": "TearingEnergy",
        },
    )

__all__ = [
    "BodyForce",
    "BodyPath",
    "BondCriterion",
    "BoundaryForce",
    "Box",
    "BuiltEnclosed",
    "Capsule",
    "CriticalEnergy",
    "CriticalStretch",
    "Cylinder",
    "Enclosed",
    "EnclosedGas",
    "EnclosedVolume",
    "Fixed",
    "Free",
    "Joint",
    "Motion",
    "Plane",
    "PointForce",
    "Pressure",
    "Reaction",
    "RigidBall",
    "RigidBody",
    "RigidContact",
    "SelfContact",
    "Sphere",
    "TearingEnergy",
    "TriangleMesh",
    "ValuesInTime",
    "horizon_for_tears",
    "length_for_tears",
    "newton_bodies",
    "notes_on_criterion",
    "stretch_or_energy",
    "stretching_edges",
]
