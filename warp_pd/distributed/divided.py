"""What one of several processes does with a sheet, however the processes are connected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..communicator import Communicator
from ..context import Context
from ..device.fields import Array, FieldRegister
from ..device.launches import Call, Stage
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from ..kernels.block_sums import BLOCK
from ..kernels.effects import Kernel
from ..laws.weight_tables import Tables, plain_weights, weight_tables
from .exchange import add_exchanges
from .local_families import builds_alone, local_cloud_families, local_rows
from .partition import partition_sheet, sheet_on_partition


class DividedSheet(Communicator):
    """A communicator of several processes (base class)."""

    def partition_sheet(self, sheet: Sheet, horizon: float, layers: int) -> Partition:
        """The partition of a whole sheet for this process."""
        return partition_sheet(sheet, horizon, self.rank, self.size, layers)

    def sheet_here(self, sheet: Sheet, partition: Partition) -> Sheet:
        """The points of a partition of a whole sheet, as a sheet."""
        return sheet_on_partition(sheet, partition)

    def tables_here(self, sheet: Sheet, partition: Partition, settings: tuple[float, Any, str]) -> Tables:
        """Families and weights of the points of a partition.

        With plain weights on a cloud, a process builds only the families of its own points.
        """
        horizon, influence, weights = settings
        if weights == "plain" and builds_alone(sheet, partition):
            families = local_cloud_families(sheet, partition, horizon, influence, self.gather)
            inverse, size = families.inverse_shapes()
            return families, inverse, plain_weights(families, size), None
        families, inverse, found, correction = weight_tables(sheet, horizon, influence, weights)
        here = local_rows(families, partition)
        return here.families, here.table(inverse), here.table(found), correction

    def add_exchanges(self, stages: Sequence[Stage], fields: FieldRegister) -> None:
        """Let the stages exchange halos where they need them."""
        assert self.partition is not None
        add_exchanges(stages, fields, self.exchange, self.partition)

    def launch_on_scattered_blocks(
        self, context: Context, stage: Stage, launch: tuple[str, Kernel, int], arrays: Mapping[str, Array | None],
        sums: Mapping[str, Array], outputs: Sequence[str], others: Mapping[str, Any],
    ) -> None:  # fmt: skip
        """`Context.launch_on_blocks` where the points of a block are in several processes: they are gathered first."""
        (owner, kernel, lanes), partition = launch, context.partition
        assert partition is not None
        given: dict[str, Any] = {**sums, **others}
        own: dict[str, Any] = {name: None if array is None else context.own(array) for name, array in arrays.items()}
        there = {name: array for name, array in arrays.items() if array is not None}
        brought = {
            name: context.array(f"{name}_in_blocks", owner, array.dtype, shape=partition.block_points, per="table")
            for name, array in there.items()
        }
        stage.call(self.gather_to_blocks([(array, brought[name]) for name, array in there.items()], partition))
        if outputs:
            blocks = -(-(partition.owned.stop - partition.owned.start) // BLOCK)
            unused = {
                name: context.array(f"unused_{name}", owner, made.dtype, shape=(*made.shape[:-1], blocks), per="table")
                for name, made in sums.items()
            }
            stage.launch(owner, kernel, lanes * blocks, **own, **{**given, **unused})
        stage.launch(owner, kernel, lanes * context.own_blocks, **{**own, **brought}, **given)

    def gather_to_blocks(self, pairs: Sequence[tuple[Array, Array]], partition: Partition) -> Call:
        """Return a function that fills the second array of each pair (points of own blocks) from the points' owners."""
        raise NotImplementedError(f"{type(self).__name__}.gather_to_blocks: expected an implementation")
