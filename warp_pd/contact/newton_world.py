"""Bodies simulated by Newton: Newton moves them, and the sheet exerts forces and torques on them.

Newton (https://github.com/newton-physics/newton) is a physics engine on Warp, with contacts, joints and motors. See
docs/bodies.md.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, positive, show
from ..device.cores import no_collection
from ..device.fields import Array
from ..device.launches import Call, Touched
from ..interfaces import BuiltContact, BuiltLaw, Contact, Part
from ..kernels.block_sums import frame_checks
from ..kernels.contact.newton_world import lead_shape, load_bodies, take_impulses
from .body_mesh import TriangleMesh
from .body_motion import BodyMotion, BuiltMotion, OnPath
from .body_shapes import BodyShape, Box, Capsule, Cylinder, Plane, Sphere
from .rigid_body import RigidBody

OWNER = "newton"


def load_newton() -> Any:
    """Import the package `newton`; no other function imports it.

    Raises:
        InputError: if it is not installed.
    """
    try:
        import newton
    except ImportError:
        raise InputError(
            "newton_bodies: expected the package newton, which is not installed (pip install 'warp-pd[bodies]')"
        ) from None
    return newton


def newton_bodies(
    builder: Any, solver: Callable[[Any], Any], step: float, shapes: Sequence[str] | None = None, collide: bool = True
) -> list[Contact]:
    """Contacts of a scene with the bodies of a Newton model; the rest of the model is simulated, too.

    Args:
        builder: A `newton.ModelBuilder`; every run builds its own model on its own device. Spheres, capsules,
            cylinders, boxes, meshes and infinite planes can touch the sheet, with their coefficient of friction.
        solver: Class or function that makes a Newton solver from a model, such as `newton.solvers.SolverXPBD`.
        step: Step of Newton's solver [s]; shortened so that a frame is a whole number of steps.
        shapes: Labels of the shapes that touch the sheet; None for all shapes that collide in Newton. The labels name
            the contacts and their columns of the history.
        collide: Whether shapes touch each other.

    Returns:
        One contact per shape, and the world that moves them. All of them must be in the scene.

    Raises:
        InputError: if Newton is not installed, for another type of builder, an unknown label, or an unsupported shape.
    """
    newton = load_newton()
    if not isinstance(builder, newton.ModelBuilder):
        raise InputError(f"newton_bodies: builder = {show(builder)}: expected a newton.ModelBuilder")
    if not callable(solver) or isinstance(solver, newton.solvers.SolverBase):
        raise InputError(f"newton_bodies: solver = {show(solver)}: expected a class or function that makes a solver")
    positive("newton_bodies: step", step)
    labels = list(builder.shape_label)
    touches = int(newton.ShapeFlags.COLLIDE_SHAPES)
    chosen = [label for label, flags in zip(labels, builder.shape_flags, strict=True) if flags & touches]
    for label in shapes or ():
        if label not in labels:
            raise InputError(f"newton_bodies: shapes: expected labels from {labels}, got {label!r}")
    poses, found = _poses(newton, builder), []
    for index in [labels.index(label) for label in (chosen if shapes is None else shapes)]:
        shape, frame = _shape(newton, builder, index)
        body = builder.shape_body[index]
        place = poses[body] * frame if body >= 0 else frame
        moving = np.array(builder.body_qd[body], float) if body >= 0 else np.zeros(6)
        motion = NewtonMotion(body, *(tuple(np.array(x, float).tolist()) for x in (frame, place, moving)))
        name = re.sub(r"\W", "_", labels[index])
        found.append(NewtonBody(shape, motion, float(builder.shape_material_mu[index]), name))
    if not found:
        raise InputError("newton_bodies: shapes: expected at least one shape that touches the sheet, got none")
    return [*found, NewtonWorld(_Recipe(builder, found), solver, step, collide)]


def _poses(newton: Any, builder: Any) -> list[wp.transformd]:
    """Initial poses of the bodies; for bodies with joints they follow from the joint coordinates."""
    if all(kind == newton.JointType.FREE for kind in builder.joint_type):
        return [wp.transformd(*map(float, pose)) for pose in builder.body_q]
    model = builder.finalize(device="cpu")
    state = model.state()
    newton.eval_fk(model, model.joint_q, model.joint_qd, state)
    return [wp.transformd(*map(float, pose)) for pose in state.body_q.numpy()]


def _shape(newton: Any, builder: Any, index: int) -> tuple[BodyShape, wp.transformd]:
    """Convert a Newton shape; also return its pose in the frame of its body."""
    kinds, kind = newton.GeoType, builder.shape_type[index]
    size = [float(x) for x in builder.shape_scale[index]]
    frame: Any = wp.transformd(*map(float, builder.shape_transform[index]))
    if kind == kinds.SPHERE:
        return Sphere(2.0 * size[0]), frame
    if kind == kinds.BOX:
        return Box((2.0 * size[0], 2.0 * size[1], 2.0 * size[2])), frame
    if kind in (kinds.CAPSULE, kinds.CYLINDER):
        return (Capsule if kind == kinds.CAPSULE else Cylinder)(2.0 * size[0], 2.0 * size[1]), frame
    if kind == kinds.PLANE and size[0] == size[1] == 0.0:
        return Plane(), frame
    if kind in (kinds.MESH, kinds.CONVEX_MESH):
        source = builder.shape_source[index]
        mesh = TriangleMesh(np.array(source.vertices, float) * size, np.array(source.indices, int).reshape(-1, 3))
        return mesh, frame * wp.transformd(wp.vec3d(*mesh.centroid.tolist()), wp.quatd(0.0, 0.0, 0.0, 1.0))
    raise InputError(
        f"newton_bodies: shape {builder.shape_label[index]!r} is a {kinds(kind).name}: expected a sphere, capsule, "
        "cylinder, box, mesh or infinite plane"
    )


@dataclass(frozen=True)
class NewtonMotion(BodyMotion):
    """Motion of a Newton shape.

    Attributes:
        body: Index of its body in Newton's model; -1 for a fixed shape.
        frame: Position [m] and unit quaternion of the shape in the frame of the body, 7 numbers.
        start: Position and quaternion of the shape in the world at time 0, 7 numbers.
        moving: Velocity of the body's centre of mass [m/s] and its spin [1/s] at time 0, 6 numbers.
    """

    body: int
    frame: tuple[float, ...]
    start: tuple[float, ...]
    moving: tuple[float, ...]

    free: ClassVar[bool] = False

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and unit quaternion at time 0; later poses are known only in the run."""
        return np.array(self.start[:3]), np.array(self.start[3:])

    def speed(self, radius: float) -> float:
        """Largest initial speed [m/s] of points within a distance [m] from the centre of mass."""
        spin = float(np.linalg.norm(self.moving[3:]))
        return float(np.linalg.norm(self.moving[:3])) + (radius * spin if spin > 0.0 else 0.0)

    def check(self, shape: BodyShape) -> None:
        """Accept every shape, because `newton_bodies` has checked it."""

    def build(self, name: str, shape: BodyShape, context: Context, friction: float) -> BuiltMotion:
        """Build a path that Newton extends during the run."""
        place, rotation = self.pose(0.0)
        knots = np.zeros(2), np.tile(place, (2, 1)), np.tile(rotation, (2, 1))
        return OnPath(name, (place, rotation), knots, context, led=True)


@dataclass(frozen=True)
class NewtonBody(RigidBody):
    """A Newton shape as a body of the scene; created by `newton_bodies`."""

    motion: NewtonMotion

    meets_others: ClassVar[bool] = True
    loads_at_rest: ClassVar[bool] = False

    def check(self, others: Sequence[Part]) -> None:
        """Check that no other body has the same name, and that the scene has its world."""
        super().check(others)
        if not any(self is body for other in others for body in getattr(other, "bodies", ())):
            raise InputError(f"contact: {self.name!r} has no Newton world: expected all contacts from newton_bodies")


class _Recipe:
    """A builder and the bodies of the scene; its repr has a hash that identifies the model in restart files."""

    def __init__(self, builder: Any, bodies: Sequence[NewtonBody]) -> None:
        self.builder, self.bodies = builder, tuple(bodies)

    def __repr__(self) -> str:
        lists = {name: values for name, values in vars(self.builder).items() if isinstance(values, list)}
        # Vertices are already in the shapes of the contacts. The repr of some Warp types has no numbers.
        data = {name: [np.array(x).tolist() for x in lists[name]] for name in lists if name != "shape_source"}
        data["gravity"] = np.array(self.builder.gravity).tolist()
        return f"{self.builder.body_count} bodies {hashlib.sha1(repr(data).encode()).hexdigest()[:12]}"


@dataclass(frozen=True)
class NewtonWorld(Contact):
    """The world that moves the Newton bodies; created by `newton_bodies`."""

    recipe: _Recipe
    solver: Callable[[Any], Any]
    step: float
    collide: bool

    only_one: ClassVar[str] = "Newton worlds: expected one"

    @property
    def bodies(self) -> tuple[NewtonBody, ...]:
        """Bodies of this world in the scene."""
        return self.recipe.bodies

    def check(self, others: Sequence[Part]) -> None:
        """Check that the scene has all bodies of this world, and no other world."""
        super().check(others)
        for body in self.bodies:
            if not any(other is body for other in others):
                raise InputError(f"contact: {body.name!r} is missing: expected all contacts from newton_bodies")

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """Build the world on a device."""
        return BuiltWorld(self, context)


class BuiltWorld(BuiltContact):
    """Newton's model, solver and state on a device."""

    label = "contact = newton_bodies"

    def __init__(self, part: NewtonWorld, context: Context) -> None:
        self.part, self.context = part, context
        newton, device = load_newton(), context.device
        with wp.ScopedDevice(device):
            self.model = part.recipe.builder.finalize(device=device)
            self.solver = part.solver(self.model)
            self.state, self._next = self.model.state(), self.model.state()
            if not all(kind == newton.JointType.FREE for kind in part.recipe.builder.joint_type):
                newton.eval_fk(self.model, self.model.joint_q, self.model.joint_qd, self.state)
            self._control = self.model.control()
            # Contacts are sorted so that bits repeat.
            self._pipeline = newton.CollisionPipeline(self.model, deterministic=True) if part.collide else None
            self._contacts = None if self._pipeline is None else self._pipeline.contacts()
        for name, array in vars(self.state).items():
            if isinstance(array, wp.array) and array.size and not name.endswith("_f"):
                field = f"newton_{name.lstrip('_')}"
                setattr(self.state, name, self._array(field, array.dtype, array.numpy(), restart=True))
        motions = [body.motion for body in part.bodies]
        self._bodies = self._array("newton_shape_body", wp.int32, np.array([m.body for m in motions]), "table")
        self._frames = self._array("newton_shape_frame", wp.transformd, np.array([m.frame for m in motions]), "table")
        rows = 6 * len(motions)
        self._given, self._before, self._last = (
            self._array(f"newton_{name}", wp.float64, np.zeros(rows), restart=True)
            for name in ("given", "before", "last")
        )
        blocks = context.own_blocks
        self._sums = context.array("newton_sums", OWNER, wp.float64, shape=(rows, blocks), per="block")
        self._impulses = context.stage("newton impulses", "after the steps of each of Newton's")
        kernel = frame_checks(context.bits).sum_vectors
        for index, body in enumerate(part.bodies):
            for place, what in enumerate(("impulse", "turn")):
                values = context.fields[f"{body.name}_{what}"]
                row = 6 * index + 3 * place
                self._impulses.launch(OWNER, kernel, blocks, values=values, row=row, sums=self._sums)
        self._seconds = 0.0
        self._steps = context.stage("newton step", "before the steps of each of Newton's")
        self._steps.call(Call("newton", OWNER, self.model.body_count, self._step, _captured, Touched()))

    def _array(self, name: str, dtype: Any, values: np.ndarray, per: str = "body", restart: bool = False) -> Array:
        return self.context.array(name, OWNER, dtype, values, per=per, restart=restart)

    def interval(self) -> float | None:
        """Longest step of Newton's solver [s]."""
        return self.part.step

    def before_interval(self, seconds: float) -> None:
        """Take a step of Newton with the mean force of the last interval; bodies move to its poses in this interval."""
        self._seconds = seconds
        self.context.sequence("newton step").run()

    def _step(self) -> None:
        model, state, fields, device = self.model, self.state, self.context.fields, self.context.device
        wp.launch(
            load_bodies, model.body_count, [self._bodies, self._frames, self._given, self._seconds, state.body_q,
            model.body_com], [state.body_f], device=device,
        )  # fmt: skip
        with wp.ScopedDevice(device):
            if self._pipeline is not None:
                self._pipeline.collide(state, self._contacts)
            self.solver.step(state, self._next, self._control, self._contacts, self._seconds)
            state.assign(self._next)
        for body in self.part.bodies:
            motion = body.motion
            if motion.body >= 0:
                path = [fields[f"{body.name}_{what}"] for what in ("times", "places", "rotations")]
                inputs = [motion.body, wp.transformd(*motion.frame), self._seconds, state.body_q]
                wp.launch(lead_shape, 1, [*inputs, self.context.clock.time], path, device=device)

    def after_interval(self) -> None:
        """Compute the impulses of the bodies on the sheet in the interval."""
        self.context.sequence("newton impulses").run()
        rows = self._given.shape[0]
        wp.launch(
            take_impulses, rows, [self._sums, self._before, self._last], [self._given], device=self.context.device
        )

    def end_frame(self) -> None:
        """Reset the earlier impulses, because the bodies reset their sums."""
        self._before.zero_()


def _captured(device: wp.Device, warm_up: Callable[[], None], body: Callable[[], None]) -> Callable[[], None]:
    """Capture Newton's step as a graph and return its replay; a warm-up would be an extra step."""
    with no_collection(), wp.ScopedCapture(device=device) as capture:
        body()
    return lambda: wp.capture_launch(capture.graph)
