"""What one of several processes does with a sheet, however the processes are connected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..communicator import Communicator
from ..device.fields import FieldRegister
from ..device.launches import Stage
from ..families.partition import Partition
from ..geometry.sheet import Sheet
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
