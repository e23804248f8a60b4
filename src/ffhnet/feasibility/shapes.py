"""The collision shapes of a hand or an arm, ready to be held against observed points and a table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from ffhnet.feasibility.nearest import NearestGrid
from ffhnet.hands.kinematics import Geom, KinematicTree


@dataclass(frozen=True)
class Near:
    """Shapes and points near each other, in any order.

    Attributes:
        row: index of the pose.
        point: index of the point in the grid.
        distance: from the shape to the point, m; negative inside.
    """

    row: Int[np.ndarray, " K"]
    point: Int[np.ndarray, " K"]
    distance: Float[np.ndarray, " K"]


@dataclass(frozen=True)
class Shapes:
    """G rounded boxes fixed to the bodies of a kinematic tree, and probes that look for points near them.

    Box, capsule and sphere are rounded boxes exactly: all points within `radius` of a box. A cylinder is
    taken as the box around it.

    Attributes:
        body: the body of each shape.
        T_body_shape: its pose there.
        half: half sides of its box, m.
        radius: m by which the box is rounded.
        probe_shape: the shape of each probe.
        probe_position: of each probe in its body's frame, m; no point of a shape is further than `pitch` from
            its nearest probe.
    """

    body: Int[np.ndarray, " G"]
    T_body_shape: Float[np.ndarray, "G 4 4"]
    half: Float[np.ndarray, "G 3"]
    radius: Float[np.ndarray, " G"]
    probe_shape: Int[np.ndarray, " Q"]
    probe_position: Float[np.ndarray, "Q 3"]

    @classmethod
    def of(cls, tree: KinematicTree, pitch: float) -> Shapes:
        """All shapes of a tree, with probes about `pitch` (m) apart."""
        half, radius = (np.array(column) for column in zip(*map(_rounded_box, tree.geoms), strict=True))
        poses = np.array([geom.T_body_geom for geom in tree.geoms])
        probes = [
            _probes(h, r, pitch) @ T[:3, :3].T + T[:3, 3] for h, r, T in zip(half, radius, poses, strict=True)
        ]
        return cls(
            body=np.array([geom.body for geom in tree.geoms]),
            T_body_shape=poses.astype(np.float32),
            half=half.astype(np.float32),
            radius=radius.astype(np.float32),
            probe_shape=np.repeat(np.arange(len(probes)), [len(p) for p in probes]),
            probe_position=np.concatenate(probes).astype(np.float32),
        )

    def place(self, T_frame_body: Float[np.ndarray, "N B 4 4"]) -> PlacedShapes:
        """The shapes where N poses of the bodies put them."""
        T_frame_body = T_frame_body.astype(np.float32, copy=False)
        T = T_frame_body[:, self.body] @ self.T_body_shape
        places = np.empty((3, len(T), len(self.probe_shape)), dtype=np.float32)
        for body, first, last in self._probes_by_body:
            T_body, probes = T_frame_body[:, body], self.probe_position[first:last]
            places[:, :, first:last] = (T_body[:, :3, :3] @ probes.T + T_body[:, :3, 3:]).swapaxes(0, 1)
        return PlacedShapes(self, T[..., :3, :3], T[..., :3, 3], places)

    @cached_property
    def _probes_by_body(self) -> list[tuple[int, int, int]]:
        """Bodies in order, and where each one's probes begin and end."""
        body = self.body[self.probe_shape]
        begins = np.flatnonzero(np.diff(body, prepend=-1))
        return list(
            zip(body[begins].tolist(), begins.tolist(), [*begins[1:].tolist(), len(body)], strict=True)
        )


@dataclass(frozen=True)
class PlacedShapes:
    """N poses of shapes in some frame.

    Attributes:
        shapes: the shapes.
        rotation, position: of each shape, m.
        places: of the probes, m.
    """

    shapes: Shapes
    rotation: Float[np.ndarray, "N G 3 3"]
    position: Float[np.ndarray, "N G 3"]
    places: Float[np.ndarray, "3 N Q"]

    def lowest(self) -> Float[np.ndarray, " N"]:
        """Height (z, m) of the lowest point of all shapes, in a frame whose z points up."""
        reach = np.abs(self.rotation[:, :, 2] * self.shapes.half).sum(axis=-1) + self.shapes.radius
        return np.asarray((self.position[:, :, 2] - reach).min(axis=1))

    def near(self, grid: NearestGrid, rows: Int[np.ndarray, " R"], shift: Float[np.ndarray, "R 3"]) -> Near:
        """What is within the grid's reach of the probes, which is all that is near the shapes.

        Args:
            grid: the points.
            rows: which of the poses.
            shift: m by which each is shifted.
        """
        shift = shift.astype(np.float32)
        places = self.places[:, rows] + shift.T[:, :, None]
        hit, point = grid.look_up(places.reshape(3, -1))
        row, probe = np.divmod(hit, places.shape[2])
        shape = self.shapes.probe_shape[probe]
        from_middle = grid.points[point] - self.position[rows[row], shape] - shift[row]
        beyond = np.abs(np.einsum("kij,ki->kj", self.rotation[rows[row], shape], from_middle))
        beyond -= self.shapes.half[shape]
        distance = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
        return Near(row, point, distance - self.shapes.radius[shape])


def _rounded_box(geom: Geom) -> tuple[tuple[float, float, float], float]:
    """Half sides and rounding radius."""
    size = geom.size
    if geom.type == "box":
        return (size[0], size[1], size[2]), 0.0
    if geom.type == "sphere":
        return (0.0, 0.0, 0.0), size[0]
    if geom.type == "capsule":
        return (0.0, 0.0, size[1]), size[0]
    return (size[0], size[0], size[1]), 0.0


def _probes(half: Float[np.ndarray, " 3"], radius: float, pitch: float) -> Float[np.ndarray, "K 3"]:
    """Points in a box, evenly spaced; on the axis of a capsule the ends are among them."""
    axes = []
    for h in half:
        if radius > 0:
            axes.append(np.linspace(-h, h, int(np.ceil(2 * h / pitch)) + 1) if h > 0 else np.zeros(1))
        else:
            count = max(int(np.ceil(2 * h / pitch)), 1)
            axes.append(((np.arange(count) + 0.5) / count * 2 - 1) * h)
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
