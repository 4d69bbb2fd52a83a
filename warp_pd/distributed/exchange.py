"""Exchanges of ghost points between processes, derived from the declared effects of launches.

Every point array is valid up to some depth outside the own points, measured in horizons: 2 just after an exchange. A
launch that reads arrays at its own point produces results valid to the same depth; one that gathers an array, one
horizon less. The required depths follow backwards: own points are depth 0, and a gathered array must be valid one
horizon deeper. Fields declared with `halo` can be exchanged; all others must be computed in the halo. So the families
of the first horizon outside are computed twice, and forces are summed in the same order on any number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace

from ..device.checks import InputError
from ..device.fields import FieldRegister, Stored
from ..device.launches import Call, Item, Launch, Stage
from ..families.partition import Partition
from ..kernels.effects import Pointwise
from .overlap import has_streams, overlap_exchanges
from .partition import HALO

# Launches that work on the own points, or on blocks of them, and those that work on more than a point's own family.
OWN_BLOCKS, LIST, WHOLE = "block", "list", ("once", "body")


@dataclass(frozen=True)
class Access:
    """Fields that a launch accesses, by index; `gathers` at other points, `reads` at its own."""

    reads: frozenset[int]
    gathers: frozenset[int]
    writes: frozenset[int]


class Exchanges:
    """Finds the exchanges of all stages.

    Attributes:
        fields: The point and bond fields that launches write, by index.
        need: Depth to which each launch must be valid, by identity.
        of_own: Identities of the launches on own points alone.
    """

    def __init__(self, stages: Sequence[Stage], fields: FieldRegister) -> None:
        self.stages = stages
        self._places = sorted(
            (int(s.array.ptr), int(s.array.ptr) + int(s.array.capacity), k)
            for k, s in enumerate(fields)
            if s.field.per in ("point", "bond") and s.array.ptr and not s.field.own_exchange
        )
        self.fields: dict[int, Stored] = dict(enumerate(fields))
        launches = [launch for stage in self.stages for launch in stage.launches()]
        written = {k for launch in launches for k in self._numbers(launch.touched.writes)}
        self._access = {id(launch): self._access_of(launch, written) for launch in launches}
        self._launches = {id(launch): launch for launch in launches}
        self.need = self._needs()
        self.of_own: Set[int] = frozenset()

    @property
    def of_points(self) -> frozenset[int]:
        """Addresses of the arrays with one entry per point."""
        return frozenset(begin for begin, _, _ in self._places)

    def numbered(self, launch: Launch) -> bool:
        """Whether the arrays of a launch begin with the first local point, i.e. none is a view of own points."""
        touched = launch.touched
        inside = (touched.reads | touched.gathers | touched.writes) - self.of_points
        return not self._numbers(inside)

    def _numbers(self, addresses: Iterable[int]) -> frozenset[int]:
        """Fields that contain these addresses; views of own points begin inside their array."""
        return frozenset(k for p in addresses for begin, end, k in self._places if begin <= p < end)

    def _access_of(self, launch: Launch, written: set[int]) -> Access:
        touched, per = launch.touched, launch.source.effects.per
        reads, gathers = self._numbers(touched.reads) & written, self._numbers(touched.gathers) & written
        if per == OWN_BLOCKS:
            reads, gathers = reads | gathers, frozenset()
        if per == LIST and launch.source.effects.gathers:
            named = self._numbers(launch.gathered)
            reads, gathers = gathers - named, gathers & named
        if per in WHOLE and gathers:
            raise InputError(
                f"{launch.owner}: {launch.name} works on all points at once, which is not supported on several "
                "processes; expected a run in one process"
            )
        return Access(reads, gathers, self._numbers(touched.writes))

    def _needs(self) -> dict[int, int]:
        need = dict.fromkeys(self._access, 0)
        while True:
            wanted: dict[int, int] = {}
            for key, access in self._access.items():
                for k in access.reads | access.gathers:
                    depth = need[key] + (k in access.gathers)
                    wanted[k] = max(wanted.get(k, 0), depth)
                    if depth > HALO:
                        raise InputError(
                            f"{self._launches[key].owner}: {self._launches[key].name} uses points up to {depth} "
                            f"horizons away: expected at most {HALO} horizons on several processes"
                        )
            new = {
                key: max((wanted.get(k, 0) for k in access.writes if not self.fields[k].field.halo), default=0)
                for key, access in self._access.items()
            }
            if new == need:
                return need
            need = new

    def leave_ghosts_out(self, owned: slice) -> None:
        """Find pointwise launches whose results are needed at own points alone, unless that costs an exchange."""
        before = self.find()
        self.of_own = {
            key
            for key, launch in self._launches.items()
            if isinstance(launch.source, Pointwise) and not self.need[key] and self.numbered(launch)
            and launch.points[0] < owned.stop and owned.start < launch.points[1]
        }  # fmt: skip
        if self.find() != before:
            self.of_own = frozenset()

    def on_own(self, launch: Launch, owned: slice) -> Launch:
        """The launch, without ghost points if these are left out."""
        if id(launch) not in self.of_own:
            return launch
        begin, end = launch.points
        return launch.on_points(max(begin, owned.start), min(end, owned.stop))

    def find(self) -> dict[str, list[dict[int, list[Stored]]]]:
        """Fields to exchange before the items of each repetition of each stage, by index of the item."""
        entry = {k: _depth_of(self.fields[k]) for access in self._access.values() for k in access.writes}
        while True:
            found: dict[str, list[dict[int, list[Stored]]]] = {}
            lowest = dict(entry)
            for stage in self.stages:
                found[stage.name] = []
                for number in range(stage.interval):
                    exchanged, leaves = self._follow(stage.round(number), entry)
                    found[stage.name].append(exchanged)
                    lowest = {k: min(depth, leaves[k]) for k, depth in lowest.items()}
            if lowest == entry:
                return found
            entry = lowest

    def _follow(
        self, items: Sequence[Item], entry: Mapping[int, int]
    ) -> tuple[dict[int, list[Stored]], dict[int, int]]:
        """Exchanges between items whose fields are valid to given depths at their start, and the depths at the end."""
        depth = dict(entry)
        found: dict[int, list[Stored]] = {}
        written_since: dict[int, set[int]] = {}
        for place, item in enumerate(items):
            if not isinstance(item, Launch):
                continue
            access, need = self._access[id(item)], self.need[id(item)]
            used = {**dict.fromkeys(access.reads, need), **dict.fromkeys(access.gathers, need + 1)}
            shallow = [k for k, wanted in used.items() if depth[k] < wanted]
            for k in shallow:
                if not self.fields[k].field.halo:
                    raise InputError(
                        f"{self.fields[k].owner}: {self.fields[k].name} is not known around the own points, "
                        "which is not supported on several processes; expected a run in one process"
                    )
                depth[k] = _depth_of(self.fields[k])
            for k in sorted(shallow):
                # Exchanges are expensive: the earliest one after the last write of the field takes it along.
                at = next((earlier for earlier, written in written_since.items() if k not in written), place)
                found.setdefault(at, []).append(self.fields[k])
                written_since.setdefault(at, set())
            for written in written_since.values():
                written.update(access.writes)
            most = 0 if id(item) in self.of_own else HALO
            gives = min([*(depth[k] for k in access.reads), *(depth[k] - 1 for k in access.gathers), most])
            for k in access.writes:
                depth[k] = min(depth[k], gives)
        return found, depth


def _depth_of(stored: Stored) -> int:
    """Depth to which a field is valid after an exchange; families of the outermost horizon are empty."""
    return HALO if stored.field.per == "point" else HALO - 1


def add_exchanges(
    stages: Sequence[Stage], fields: FieldRegister, exchange: Callable[[Sequence[Stored], Partition], Call],
    partition: Partition,
) -> None:  # fmt: skip
    """Insert halo exchanges into all stages."""
    exchanges, owned = Exchanges(stages, fields), partition.owned
    exchanges.leave_ghosts_out(owned)
    found = exchanges.find()
    for stage in stages:
        rounds: list[list[Item]] = []
        for number, places in enumerate(found[stage.name]):
            items: list[Item] = []
            added: set[int] = set()
            for place, item in enumerate(stage.round(number)):
                if place in places:
                    call = exchange(places[place], partition)
                    items.append(call)
                    added.add(id(call))
                items.append(exchanges.on_own(item, owned) if isinstance(item, Launch) else item)
            if any(place <= stage.leading for place in places):
                stage.wraparound = None
            if stage.wraparound is not None:
                stage.wraparound = exchanges.on_own(stage.wraparound, owned)
            if has_streams(stage.device):
                items = overlap_exchanges(items, added, partition, exchanges.of_points, exchanges.numbered)
            rounds.append(items)
        if len(rounds) > 1:
            # Repetitions with different launches have different exchanges.
            rounds = [[replace(i, every=len(rounds), since=n) for i in items] for n, items in enumerate(rounds)]
        stage.items = [item for items in rounds for item in items]
