"""The context in which parts are built: device, precision, arrays, stages, and the state shared by all parts."""

from __future__ import annotations

import functools
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp

from .communicator import Communicator
from .device.checks import InputError
from .device.clock import Clock
from .device.cores import require_no_cuda_of_parent, start_warp
from .device.fields import Array, Field, FieldRegister, Stored, to_host
from .device.graph import LaunchSequence, run_once
from .device.launches import Launch, Stage, compile_launches
from .families.partition import Partition
from .geometry.sheet import Sheet
from .geometry.triangulation import CoarseLattice
from .kernels import block_sums
from .kernels.effects import Kernel
from .kernels.families import Layout
from .kernels.integrate import StepOptions
from .kernels.numeric import Numeric
from .materials import capabilities

# Below this number of points, small blocks let a launch use all multiprocessors of a GPU.
SMALL, SMALL_BLOCK, BLOCK = 2**17, 64, 256
# Largest round-off of a position, over the spacing.
RESOLVED = 0.02


def find_device(name: str | None) -> wp.Device:
    """The Warp device of that name.

    Raises:
        InputError: if it does not exist; a CPU never replaces a requested GPU.
    """
    start_warp()
    present = [d.alias for d in wp.get_devices()]
    known = ", ".join(repr(alias) for alias in present)
    if name != "cpu" and wp.is_cuda_available():
        require_no_cuda_of_parent(name or "cuda:0")
    if name is None:
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    if name == "cuda" and not wp.is_cuda_available():
        raise InputError(f"device = {name!r}: no CUDA device was found; expected one of {known}")
    if name != "cuda" and name not in present:
        raise InputError(f"device = {name!r}: expected one of {known}")
    return wp.get_device(name)


def with_material(layout: Layout, material: Any) -> Layout:
    """The layout for a law with this material."""
    known = capabilities(material)
    remembers = known.remembers is not None
    return replace(
        layout, regions=bool(known.regions), by_point=known.by_point is not None and not remembers, remembers=remembers
    )


@dataclass(eq=False)
class State:
    """Arrays shared by all parts, [points] unless noted; None if the scene does not need them.

    Attributes:
        displacement: Displacement u [m], vec3.
        velocity: Velocity at full steps [m/s], vec3.
        force: Internal force [N], vec3.
        mass: Mass [kg].
        external: External force [N], vec3.
        held_mask: Bits of held components, uint8: 1, 2, 4 for x, y, z; 8 in a rigid inclusion.
        step: Time step [s], one number.
        damping: Mass damping [1/s], one number.
        work: External work [J], float64.
        dissipated: Energy lost to damping [J], float64.
    """

    displacement: Array
    velocity: Array
    force: Array
    mass: Array
    external: Array | None = None
    held_mask: Array | None = None
    step: Array | None = None
    damping: Array | None = None
    work: Array | None = None
    dissipated: Array | None = None


@dataclass(eq=False)
class Context:
    """The arrays and launches of all parts.

    Attributes:
        sheet: The stress-free sheet, restricted to the points of this process.
        device: The Warp device.
        types: Types of the precision.
        options: What the kernels of a step compile.
        layout: Layout of the families; what the material adds is known once the law is.
        dynamic: Whether the solver steps in time.
        at_rest: Whether contact and rupture act in equilibrium, as with static solvers and in implicit steps.
        held: Bits of held components, uint8, shape (N,), on the host; see State.held_mask.
        initial_displacement: Initial displacement from the stress-free state [m], shape (N, 3).
        fields: All arrays.
        clock: Time and schedules.
        given: The whole sheet as given by the scene, in its clamped position.
        placement: Displacement that stretched the sheet before it was clamped [m], shape (N, 3), or None. Displacements
            of supports and frames are relative to it.
        undivided: The whole stress-free sheet, if it is divided among several processes.
        partition: The part of the sheet in this process; None for a single process.
        communicator: The communicator between the processes.
        block_dim: Threads per block on CUDA, common to most launches because kernels are compiled for it.
        stages: Stages by name, in the order of their creation.
        prefix: Prefix of the names of stages, used for coarser sheets of the same simulation.
        support_readers: Points with held and free components of which a part or a measure gives the force of
            supports, by its name.
        state: Arrays shared by all parts.
    """

    sheet: Sheet
    device: wp.Device
    types: Numeric
    options: StepOptions
    layout: Layout
    held: np.ndarray
    initial_displacement: np.ndarray
    fields: FieldRegister
    clock: Clock
    given: Sheet
    dynamic: bool = False
    at_rest: bool = True
    undivided: Sheet | None = None
    placement: np.ndarray | None = None
    partition: Partition | None = None
    communicator: Communicator = field(default_factory=Communicator)
    block_dim: int = BLOCK
    stages: dict[str, Stage] = field(default_factory=dict)
    prefix: str = ""
    support_readers: dict[str, np.ndarray] = field(default_factory=dict)
    state: State = field(init=False)
    _sequences: dict[tuple[str, int, int], LaunchSequence] = field(init=False, default_factory=dict)

    @property
    def whole(self) -> Sheet:
        """The whole stress-free sheet, on any number of processes."""
        return self.sheet if self.undivided is None else self.undivided

    @functools.cached_property
    def clamped_positions(self) -> np.ndarray:
        """Positions of the points [m], shape (N, 3), from which displacements of supports and frames count."""
        return self.here(self.given.positions)

    @property
    def bits(self) -> int:
        """Precision, 32 or 64."""
        return self.types.bits

    def require_resolved(self, name: str) -> None:
        """Check that its precision resolves the positions of the points, which the part `name` computes with.

        Raises:
            InputError: if the sheet is too far from the origin.
        """
        farthest, spacing = float(np.abs(self.whole.positions).max()), self.whole.spacing
        if farthest * np.finfo(f"float{self.bits}").eps > RESOLVED * spacing:
            raise InputError(
                f"{name}: the sheet reaches {farthest:.4g} m from the origin, and {self.bits} bits do not resolve "
                f"its spacing of {spacing:.3g} m: expected smaller coordinates" + ", or precision 64" * (self.bits < 64)
            )

    def array(
        self,
        name: str,
        owner: str,
        dtype: Any,
        values: Any = None,
        *,
        shape: Any = None,
        per: str = "point",
        restart: bool = False,
        halo: bool = False,
        own_exchange: bool = False,
        intermediate: bool = False,
        output: str = "",
        volume: Array | np.ndarray | None = None,
    ) -> Array:
        """Declare a field (see `Field`) and allocate it with `values`, or with zeros of shape `shape`.

        Raises:
            ValueError: for a field of points that has not an entry for each of them.
        """
        declared = Field(name, owner, per, restart, halo, own_exchange, intermediate, output, volume)
        array = self.fields.allocate(declared, dtype, values, shape)
        if per == "point" and self.sheet.size not in array.shape:
            raise ValueError(
                f"{owner}: {name} has the shape {array.shape}: expected {self.sheet.size}, one for each point, or a "
                "`per` other than 'point'"
            )
        return array

    def shared_array(self, name: str, owner: str, dtype: Any, shape: Any, per: str) -> Array:
        """An array of several parts, which the first of them that asks for it declares; see `array`."""
        try:
            return self.fields[name]
        except KeyError:
            return self.array(name, owner, dtype, shape=shape, per=per)

    def own(self, array: Array) -> Array:
        """View of the own points of a point array; the whole array for a single process."""
        return array if self.partition is None else array[self.partition.owned]

    @property
    def own_blocks(self) -> int:
        """Number of own blocks of points; sums are computed by block."""
        points = self.sheet.size if self.partition is None else self.partition.block_points
        return -(-points // block_sums.BLOCK)

    def launch_on_blocks(
        self,
        stage: Stage,
        owner: str,
        kernel: Kernel,
        arrays: Mapping[str, Array | None],
        sums: Mapping[str, Array],
        outputs: Sequence[str] = (),
        lanes: int = 1,
        **others: Any,
    ) -> None:
        """Add the launch of a kernel that sums over blocks of points.

        Args:
            stage: Stage to which it is added.
            owner: The part that adds it.
            kernel: The kernel.
            arrays: Its point arrays, by argument.
            sums: Arrays of block sums that it writes, by argument.
            outputs: Arguments in `arrays` that it writes.
            lanes: Threads that share a block.
            others: Other arguments.
        """
        partition = self.partition
        if partition is None or partition.owners is None:
            own = {name: None if array is None else self.own(array) for name, array in arrays.items()}
            given: dict[str, Any] = {**own, **sums, **others}
            stage.launch(owner, kernel, lanes * self.own_blocks, **given)
            return
        self.communicator.launch_on_scattered_blocks(self, stage, (owner, kernel, lanes), arrays, sums, outputs, others)

    def all_blocks(self, stage: Stage, sums: Array, name: str, owner: str) -> Array:
        """Block sums [rows, blocks] gathered from all processes in a stage; the array itself for a single process."""
        if self.partition is None:
            return sums
        shape = (sums.shape[0], -(-self.whole.size // block_sums.BLOCK))
        everything = self.array(name, owner, sums.dtype, shape=shape, per="table")
        stage.call(self.communicator.gather_blocks(sums, everything, self.partition))
        return everything

    def few_blocks(self, stage: Stage, sums: Array, name: str, owner: str, maxima: int = 0) -> Array:
        """Like `all_blocks`, but many blocks are added up in groups; of the last `maxima` rows the largest is taken."""
        found = self.all_blocks(stage, sums, name, owner)
        while found.shape[1] > block_sums.MANY_BLOCKS:
            shape = (found.shape[0], -(-found.shape[1] // block_sums.GROUP))
            shorter = self.array(f"{name}_in_groups", owner, found.dtype, shape=shape, per="table")
            stage.launch(
                owner, block_sums.add_groups, shorter.size, sums=found, maxima=maxima, group=block_sums.GROUP,
                shorter=shorter,
            )  # fmt: skip
            found = shorter
        return found

    def whole_array(self, array: Array, coarse: CoarseLattice | None = None) -> np.ndarray:
        """Copy a field of the whole sheet, or its `coarse` points, to the host; of several processes only in `root`."""
        if self.partition is None:
            return to_host(array, None if coarse is None else coarse.points())
        index, stored = next((k, s) for k, s in enumerate(self.fields) if s.array is array)
        return self.communicator.gather_field(stored, index, self.partition, coarse)

    def total(self, array: Array) -> float:
        """Sum of a point array over the whole sheet, in an order that does not depend on the number of processes."""
        found = self.communicator.broadcast(self.communicator.root(lambda: float(self.whole_array(array).sum())))
        assert found is not None
        return found

    def values_here(self, stored: Stored, whole: np.ndarray) -> np.ndarray:
        """The part of a whole-sheet field that belongs to this process, on the host."""
        partition, per = self.partition, stored.field.per
        if partition is None or per not in ("point", "bond", "face"):
            return whole
        if per == "face":
            return np.asarray(whole[partition.faces])
        if per == "point":
            return partition.rows(whole)
        # Incomplete families are empty.
        found = np.asarray(whole[:, partition.points])
        found[:, ~partition.near] = 0
        return found

    @property
    def areas(self) -> np.ndarray:
        """Area of each point of the sheet as given by the scene, clamped [m^2], (N,): what loads per area act on."""
        stretch = self.given.stretch
        return self.sheet.areas if stretch is None else self.sheet.areas * abs(float(np.linalg.det(stretch)))

    def here(self, values: np.ndarray) -> np.ndarray:
        """The part of a whole-sheet point array that belongs to this process."""
        return values if self.partition is None else self.partition.rows(values)

    def number(self, point: int) -> int:
        """Index in the whole sheet of a point of this process."""
        return point if self.partition is None else int(self.partition.points[point])

    def stage(self, name: str, when: str) -> Stage:
        """Create an empty stage under a new name; `when` says in words how often it runs, for `warp-pd plan`."""
        name = self.prefix + name
        if name in self.stages:
            raise ValueError(f"stage {name!r} already exists: expected a new name")
        self.stages[name] = Stage(name, when, self.device, self.block_dim, [])
        return self.stages[name]

    def on(self, sheet: Sheet, prefix: str, held: np.ndarray) -> Context:
        """Context of equilibrium on another sheet, with a separate state and prefixed stage names."""
        return replace(
            self, sheet=sheet, undivided=None, prefix=prefix, held=held,
            options=StepOptions(self.bits, bool(held.any()), self.options.loaded, damped=False, tracked=False),
            layout=replace(
                self.layout, kind=sheet.layout, curved=sheet.frames is not None, breakable=False, softened=False
            ),
            dynamic=False, initial_displacement=np.zeros((sheet.size, 3)), placement=None,
        )  # fmt: skip

    def sequence(self, name: str, repeat: int = 1, begin: int = 0) -> LaunchSequence:
        """The launches of a stage as a repeatable sequence, created on first use; `begin` is the first item."""
        key = name, repeat, begin
        if key not in self._sequences:
            self._sequences[key] = LaunchSequence(self.stages[self.prefix + name], repeat, begin)
        return self._sequences[key]

    def run(self, name: str) -> None:
        """Run a stage once, now."""
        if self.device.is_cuda:
            run_once(self.device, self.stages[self.prefix + name])
        else:
            self.sequence(name).run()

    def compile(self) -> float:
        """Compile or load every kernel now, and return the time taken [s]."""
        begin = time.perf_counter()
        launches: Iterable[Launch] = [launch for stage in self.stages.values() for launch in stage.launches()]
        compile_launches(launches, self.device)
        return time.perf_counter() - begin
