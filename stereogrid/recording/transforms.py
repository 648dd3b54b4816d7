"""How frames stand to one another, as the messages on /tf and /tf_static tell it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray, between, inverse
from . import ros2_messages as ros2
from .contents import TRANSFORMS, Contents
from .odometry_path import Stamps
from .raw_recording import MAX_GAP_S

WORLDS = ("odom", "map", "world")
"""Frames in which a robot moves, the smoothest first."""


@dataclass(frozen=True)
class Edge:
    """A frame in its parent's: T_parent_child (K, 4, 4) at stamps_ns (K,), increasing; one alone where it is fixed."""

    parent: str
    stamps_ns: Stamps
    T_parent_child: FloatArray

    @property
    def fixed(self) -> bool:
        """Whether it never moves."""
        return len(self.stamps_ns) == 1

    def at(self, stamps_ns: Stamps) -> FloatArray:
        """T_parent_child (M, 4, 4) at moments (M,) from its first stamp to its last, on the shortest way between."""
        if self.fixed:
            return np.repeat(self.T_parent_child, len(stamps_ns), axis=0)
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, len(self.stamps_ns) - 1)
        span_ns = self.stamps_ns[after] - self.stamps_ns[after - 1]
        share = np.clip((stamps_ns - self.stamps_ns[after - 1]) / span_ns, 0.0, 1.0)
        return between(self.T_parent_child[after - 1], self.T_parent_child[after], share)

    def knows(self, stamps_ns: Stamps) -> NDArray[np.bool_]:
        """Whether it is told (M,) at moments (M,), or often enough around them to lie between."""
        last = len(self.stamps_ns) - 1
        after = np.minimum(np.searchsorted(self.stamps_ns, stamps_ns), last)
        gap_ns = self.stamps_ns[after] - self.stamps_ns[np.maximum(after - 1, 0)]
        near = (self.stamps_ns[after] == stamps_ns) | (gap_ns <= MAX_GAP_S * 1e9)
        known: NDArray[np.bool_] = near & (stamps_ns >= self.stamps_ns[0]) & (stamps_ns <= self.stamps_ns[last])
        return known


class Transforms:
    """A tree of frames. n_wrong: transforms that are NaN or no rotation, which are passed over.

    What is told again and again and never changes is fixed, as ROS 1 tells fixed frames. A frame that is told in
    several parents is in the one of which most is told.
    """

    def __init__(self, contents: Contents) -> None:
        self.n_wrong = 0
        told: dict[tuple[str, str], list[Any]] = {}
        for stamped in contents.static_transforms:
            told[_names(stamped)] = [stamped]
        decode = ros2.decoder(TRANSFORMS)
        for message in contents.transforms:
            for stamped in decode(message).transforms:
                told.setdefault(_names(stamped), []).append(stamped)
        self._edges: dict[str, Edge] = {}
        for (child, parent), each in sorted(told.items(), key=lambda item: len(item[1])):
            edge = self._edge(parent, each)
            if edge is not None:
                self._edges[child] = edge

    @property
    def frames(self) -> list[str]:
        """All that are told of."""
        return sorted({*self._edges, *(edge.parent for edge in self._edges.values())})

    @property
    def world(self) -> bool:
        """Whether something moves in a frame of the world."""
        return any(not edge.fixed and last_name(edge.parent) in WORLDS for edge in self._edges.values())

    def fixed(self, a: str, b: str) -> FloatArray | None:
        """T_a_b (4, 4) of two frames that do not move against each other; None where nothing tells of that."""
        ups = self._fixed_up(a), self._fixed_up(b)
        common = next((frame for frame in ups[0] if frame in ups[1]), None)
        return None if common is None else inverse(ups[0][common]) @ ups[1][common]

    def fixed_relatives(self, frame: str) -> list[str]:
        """The frames that do not move against a frame, itself the first."""
        top = list(self._fixed_up(frame))[-1]
        others = (each for each in self.frames if each != frame)
        return [frame, *(each for each in others if list(self._fixed_up(each))[-1] == top)]

    def moving(self, frame: str) -> tuple[str, str, Stamps, FloatArray] | None:
        """Where a frame's fixed relatives are in the world: the names of the world and of the highest of the relatives,
        and its poses (K, 4, 4) in the world at stamps (K,). None where nothing tells of that."""
        body = list(self._fixed_up(frame))[-1]
        chain = [body, *self._above(body)]
        if len(chain) < 2:
            return None
        worlds = [each for name in WORLDS for each in chain[1:] if last_name(each) == name]
        world = worlds[0] if worlds else chain[-1]
        edges = [self._edges[child] for child in chain[: chain.index(world)]]
        stamps_ns = _common_stamps([edge for edge in edges if not edge.fixed])
        if len(stamps_ns) == 0:
            return None
        T = np.tile(np.eye(4), (len(stamps_ns), 1, 1))
        for edge in edges:
            T = edge.at(stamps_ns) @ T
        return world, body, stamps_ns, T

    def _above(self, frame: str) -> list[str]:
        """The frames above one, the nearest first; a ring ends where it closes."""
        above: list[str] = []
        while frame in self._edges and self._edges[frame].parent not in (*above, frame):
            frame = self._edges[frame].parent
            above.append(frame)
        return above

    def _fixed_up(self, frame: str) -> dict[str, FloatArray]:
        """T_above_frame (4, 4) by name of the frame itself and those above it that do not move against it."""
        found = {frame: np.eye(4)}
        for child, parent in pairwise([frame, *self._above(frame)]):
            if not self._edges[child].fixed:
                break
            found[parent] = self._edges[child].T_parent_child[0] @ found[child]
        return found

    def _edge(self, parent: str, told: Sequence[Any]) -> Edge | None:
        stamps_ns = np.array([ros2.header_stamp_ns(each.header) for each in told], np.int64)
        T, wrong = ros2.read_transforms([each.transform for each in told])
        self.n_wrong += int(wrong.sum())
        stamps_ns, first = np.unique(stamps_ns[~wrong], return_index=True)
        T = T[~wrong][first]
        if len(stamps_ns) == 0:
            return None
        # Exactly: whoever tells a fixed transform again tells the same numbers. A robot in the world may stand still.
        fixed = len(T) == 1 or bool((T[0] == T).all() and last_name(parent) not in WORLDS)
        return Edge(parent, stamps_ns[:1], T[:1]) if fixed else Edge(parent, stamps_ns, T)


def _names(stamped: Any) -> tuple[str, str]:
    """Of the child and the parent."""
    return frame_name(stamped.child_frame_id), frame_name(stamped.header.frame_id)


def frame_name(frame: str) -> str:
    """As ROS 2 writes it: ROS 1 knows frames with a leading slash."""
    return frame.lstrip("/")


def last_name(frame: str) -> str:
    """What a frame is called within its robot's names: odom of robot1/odom."""
    return frame.rsplit("/", 1)[-1]


def _common_stamps(edges: Iterable[Edge]) -> Stamps:
    """The stamps of the edge that is told most often, where all of them are known."""
    edges = list(edges)
    if not edges:
        return np.zeros(0, np.int64)
    stamps_ns = max((edge.stamps_ns for edge in edges), key=len)
    common: Stamps = stamps_ns[np.all([edge.knows(stamps_ns) for edge in edges], axis=0)]
    return common
