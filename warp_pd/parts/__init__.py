"""The parts of a scene: supports, loads, contact, rupture. Each file has the user's class and its built counterpart."""

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
