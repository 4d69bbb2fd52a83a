"""The context in which parts are built: device, precision, arrays, stages, and the arrays that parts have in common."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp

from ..device.checks import InputError
from ..device.clock import Clock
from ..device.cores import start_warp
from ..device.fields import Array, Field, FieldRegister, Stored, to_host
from ..device.graph import LaunchSequence, run_once
from ..device.launches import Launch, Stage, compile_launches
from ..families.partition import BLOCK as SUM_BLOCK
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from ..geometry.triangulation import CoarseLattice
from ..kernels.effects import Kernel
from ..kernels.families import Layout
from ..kernels.numeric import Numeric
from .communicator import Communicator

# Below this number of points, small blocks let a launch use all multiprocessors of a GPU.
SMALL, SMALL_BLOCK, BLOCK = 2**17, 64, 256


def find_device(name: str | None) -> wp.Device:
    """The Warp device of that name.

    Raises:
        InputError: if it does not exist; a CPU never replaces a requested GPU.
    """
    start_warp()
    present = [d.alias for d in wp.get_devices()]
    known = ", ".join(repr(alias) for alias in present)
    if name is None:
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    if name == "cuda" and not wp.is_cuda_available():
        raise InputError(f"device = {name!r}: no CUDA device was found; expected one of {known}")
    if name != "cuda" and name not in present:
        raise InputError(f"device = {name!r}: expected one of {known}")
    return wp.get_device(name)


@dataclass(frozen=True)
class Features:
    """Requirements of the parts of a scene on the kernels that they have in common.

    Attributes:
        held: Whether any component of any point is held.
        loaded: Whether external forces act.
        damped: Whether there is mass damping.
        tracked: Whether external work and losses are summed.
        breakable: Whether bonds can break.
        softened: Whether a damage field takes stiffness from families.
        contact: Whether a contact may change velocities.
        half_steps: Whether the energy balance may take the velocities at half steps.
        dynamic: Whether the solver steps in time.
    """

    held: bool = False
    loaded: bool = False
    damped: bool = False
    tracked: bool = False
    breakable: bool = False
    softened: bool = False
    contact: bool = False
    half_steps: bool = True
    dynamic: bool = False


@dataclass(eq=False)
class State:
    """Arrays that parts have in common, [points] unless noted; None if the scene does not need them.

    Attributes:
        displacement: u [m], vec3.
        velocity: [m/s], vec3, at full steps.
        force: Internal force [N], vec3.
        mass: [kg].
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
    """The arrays and launches of the parts.

    Attributes:
        sheet: The sheet, without stress; the points of this process if it is divided among several.
        device: The Warp device.
        types: Types of the precision.
        features: Requirements of the parts on common kernels.
        held: Bits of held components, uint8, shape (N,), on the host; see State.held_mask.
        initial_displacement: From the state without stress [m], shape (N, 3).
        fields: All arrays.
        clock: Time and schedules.
        given: The whole sheet as the scene gives it, where it is clamped.
        placement: What stretched the sheet before it was clamped [m], shape (N, 3): displacements of supports and
            frames are counted from there; or None.
        undivided: The whole sheet, without stress, if it is divided among several processes.
        partition: What is here of the sheet; None if it is all here.
        communicator: The processes among which it is divided.
        block_dim: Threads per block on CUDA; one number for most launches, as kernels are compiled for it.
        stages: Stages by name, in the order of their creation.
        prefix: Prefix of the names of stages; coarser sheets of the same simulation have one.
        compact: Name of the influence function of a cloud whose families take few bytes (kernels/families.py);
            empty on all other sheets.
        regions: Whether bonds have several materials (kernels/by_region.py); the force law, built first, says so.
        state: Arrays that parts have in common.
    """

    sheet: Sheet
    device: wp.Device
    types: Numeric
    features: Features
    held: np.ndarray
    initial_displacement: np.ndarray
    fields: FieldRegister
    clock: Clock
    given: Sheet
    undivided: Sheet | None = None
    placement: np.ndarray | None = None
    partition: Partition | None = None
    communicator: Communicator = field(default_factory=Communicator)
    block_dim: int = BLOCK
    stages: dict[str, Stage] = field(default_factory=dict)
    prefix: str = ""
    compact: str = ""
    regions: bool = False
    state: State = field(init=False)
    _sequences: dict[tuple[str, int, int], LaunchSequence] = field(init=False, default_factory=dict)

    @property
    def whole(self) -> Sheet:
        """The whole sheet, without stress, whoever has it."""
        return self.sheet if self.undivided is None else self.undivided

    @property
    def bits(self) -> int:
        """Precision, 32 or 64."""
        return self.types.bits

    @property
    def layout(self) -> Layout:
        """Layout of the families."""
        sheet, f = self.sheet, self.features
        return Layout(
            sheet.layout, self.bits, sheet.frames is not None, self.compact, f.breakable, f.softened, self.regions
        )

    def use_compact_families(self, influence: str) -> None:
        """Let the families of a cloud take few bytes; for the force law, which is built before any kernel is made.

        Args:
            influence: As `compact`.
        """
        if influence:
            self.compact = influence

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
        output: str = "",
        density: bool = False,
    ) -> Array:
        """Declare a field (see `Field`) and allocate it, filled with `values` or with zeros of `shape`."""
        declared = Field(name, owner, per, restart, halo, own_exchange, output, density)
        return self.fields.allocate(declared, dtype, values, shape)

    def own(self, array: Array) -> Array:
        """The own points of an array of points, as a view; all of them if one process has the whole sheet."""
        return array if self.partition is None else array[self.partition.owned]

    @property
    def own_blocks(self) -> int:
        """Number of own blocks of points, by which sums go."""
        points = self.sheet.size if self.partition is None else self.partition.block_points
        return -(-points // SUM_BLOCK)

    def launch_on_blocks(
        self,
        stage: Stage,
        owner: str,
        kernel: Kernel,
        arrays: Mapping[str, Array | None],
        sums: Mapping[str, Array],
        outputs: Sequence[str] = (),
        **others: Any,
    ) -> None:
        """Add the launch of a kernel that sums over blocks of points.

        Args:
            stage: Where to add it.
            owner: The part that adds it.
            kernel: The kernel.
            arrays: Its arrays of points, by argument.
            sums: What it writes for each block, by argument.
            outputs: Those of `arrays` that it writes.
            others: Its other arguments.
        """
        partition = self.partition
        given: dict[str, Any] = {**sums, **others}
        own: dict[str, Any] = {name: None if array is None else self.own(array) for name, array in arrays.items()}
        if partition is None or partition.owners is None:
            stage.launch(owner, kernel, self.own_blocks, **own, **given)
            return
        # Where points are scattered, the processes bring those of their blocks together.
        there = {name: array for name, array in arrays.items() if array is not None}
        brought = {
            name: self.array(f"{name}_in_blocks", owner, array.dtype, shape=partition.block_points, per="table")
            for name, array in there.items()
        }
        stage.call(
            self.communicator.gather_to_blocks([(array, brought[name]) for name, array in there.items()], partition)
        )
        if outputs:
            blocks = -(-(partition.owned.stop - partition.owned.start) // SUM_BLOCK)
            unused = {
                name: self.array(f"unused_{name}", owner, made.dtype, shape=(*made.shape[:-1], blocks), per="table")
                for name, made in sums.items()
            }
            stage.launch(owner, kernel, blocks, **own, **{**given, **unused})
        stage.launch(owner, kernel, self.own_blocks, **{**own, **brought}, **given)

    def all_blocks(self, stage: Stage, sums: Array, name: str, owner: str) -> Array:
        """Sums [rows, blocks] of all processes, brought together in a stage; the array itself if there is one."""
        if self.partition is None:
            return sums
        shape = (sums.shape[0], -(-self.whole.size // SUM_BLOCK))
        everything = self.array(name, owner, sums.dtype, shape=shape, per="table")
        stage.call(self.communicator.gather_blocks(sums, everything, self.partition))
        return everything

    def whole_array(self, array: Array, coarse: CoarseLattice | None = None) -> np.ndarray:
        """A copy of a field on the host, of the whole sheet; with several processes within `Communicator.root` only.

        Args:
            array: The field.
            coarse: The points to copy, of a field of points; None: all.
        """
        if self.partition is None:
            return to_host(array, None if coarse is None else coarse.points())
        index, stored = next((k, s) for k, s in enumerate(self.fields) if s.array is array)
        return self.communicator.gather_field(stored, index, self.partition, coarse)

    def total(self, array: Array) -> float:
        """Sum of an array of points of the whole sheet, in one order on any number of processes."""
        found = self.communicator.broadcast(self.communicator.root(lambda: float(self.whole_array(array).sum())))
        assert found is not None
        return found

    def values_here(self, stored: Stored, whole: np.ndarray) -> np.ndarray:
        """What is here of the values of a field of the whole sheet, on the host."""
        partition, per = self.partition, stored.field.per
        if partition is None or per not in ("point", "bond", "face"):
            return whole
        if per == "face":
            return np.asarray(whole[partition.faces])
        if per == "point":
            return partition.rows(whole)
        # Families that are not whole here are empty.
        found = np.asarray(whole[:, partition.points])
        found[:, ~partition.near] = 0
        return found

    def here(self, values: np.ndarray) -> np.ndarray:
        """What is here of an array of points of the whole sheet."""
        return values if self.partition is None else self.partition.rows(values)

    def number(self, point: int) -> int:
        """Number of a point here in the whole sheet."""
        return point if self.partition is None else int(self.partition.points[point])

    def stage(self, name: str, when: str) -> Stage:
        """A new stage.

        Args:
            name: Its name.
            when: How often it runs, for `plan`.

        Raises:
            ValueError: if it exists.
        """
        name = self.prefix + name
        if name in self.stages:
            raise ValueError(f"stage {name!r} exists already: expected a new name")
        self.stages[name] = Stage(name, when, self.device, self.block_dim, [])
        return self.stages[name]

    def on(self, sheet: Sheet, prefix: str, features: Features, held: np.ndarray) -> Context:
        """A context for another sheet of the same simulation, with its own state and stages of another prefix."""
        start = np.zeros((sheet.size, 3))
        return replace(
            self, sheet=sheet, undivided=None, prefix=prefix, features=features, held=held, initial_displacement=start,
            placement=None, compact="",
        )  # fmt: skip

    def sequence(self, name: str, repeat: int = 1, begin: int = 0) -> LaunchSequence:
        """The launches of a stage, ready to run any number of times; made on first use. For `begin` see there."""
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
        """Build or load every kernel now; returns the seconds it took."""
        begin = time.perf_counter()
        launches: Iterable[Launch] = [launch for stage in self.stages.values() for launch in stage.launches()]
        compile_launches(launches, self.device)
        return time.perf_counter() - begin
