"""What stands in the browser's scene: table, cloud, object, coloured hands, and one hand that moves."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
import trimesh
import viser
from jaxtyping import Float, Int

from ffhnet.apps.viewer.motion import Frame
from ffhnet.apps.viewer.sight import Sight
from ffhnet.evaluation.shapes import cloud_colors, color_scale, link_colors
from ffhnet.geometry.rotations import quaternion_from_matrix
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand

FIELD_OF_VIEW = np.radians(32.0)

MAX_FACES = 1200
"""Most faces of a link, so that dozens of hands are drawn at once; primitive shapes have fewer."""

_AROUND = 0.24
"""m around an object that the camera sees: the hands stand there."""

_ABOVE = 0.1
"""m above an object's middle to which the camera looks: there it is lifted."""

_POINT = 0.0022  # m
_PALM_OPACITY = 0.35
_OBJECT = (236, 190, 130)
_SQUARE = 0.05  # m
_TABLE = (238, 240, 243)
_LINES = (214, 218, 224)


@dataclass(frozen=True)
class _Part:
    """Several links of a hand as one mesh: vertices (m) in the frames of their links."""

    vertices: Float[np.ndarray, "V 3"]
    link: Int[np.ndarray, " V"]
    faces: Int[np.ndarray, "F 3"]


class Stage:
    """The scene of one server; everything is in the world frame of a `Sight`."""

    def __init__(self, server: viser.ViserServer, hand: Hand, clicked: Callable[[int], None]) -> None:
        """Sets up lights and table; `clicked` is called with the index of the grasp whose hand is clicked."""
        self._server, self._hand, self._clicked = server, hand, clicked
        self._scene = server.scene
        self._links = [i for i, mesh in enumerate(hand.body_shapes) if len(mesh.faces)]
        self._meshes = {i: _light(hand.body_shapes[i]) for i in self._links}
        self._parts = {"palm": _join(self._meshes, [0]), "fingers": _join(self._meshes, self._links[1:])}
        self._crowd: dict[int, list[viser.MeshHandle]] = {}
        self._moving: dict[int, viser.MeshHandle] = {}
        self._object: viser.MeshHandle | None = None
        self._scene.set_up_direction("+z")
        self._scene.world_axes.visible = False
        # One sun with shadows, and light from everywhere that leaves the colours as the legend has them.
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/sky", intensity=1.8)
        self._scene.add_grid(
            "/table",
            plane="xy",
            infinite_grid=True,
            cell_size=_SQUARE,
            cell_color=_LINES,
            section_size=1000.0,
            section_color=_LINES,
            plane_color=_TABLE,
            plane_opacity=1.0,
            shadow_opacity=0.3,
            fade_distance=2.5,
        )

    def show_sight(self, sight: Sight) -> None:
        """The cloud, and the object itself where it is known (hidden until it moves)."""
        self._scene.add_point_cloud(
            "/cloud",
            points=sight.cloud.astype(np.float32),
            colors=cloud_colors(sight.cloud),
            point_size=_POINT,
            point_shape="circle",
            precision="float32",
        )
        self.show_crowd(sight.grasps, [])
        if self._object is not None:
            self._object.remove()
            self._object = None
        if sight.known is not None:
            mesh = sight.known.obj.visual.smooth_shaded
            self._object = self._scene.add_mesh_simple(
                "/object", mesh.vertices, mesh.faces, color=_OBJECT, visible=False
            )

    def frame_camera(self, sight: Sight) -> None:
        """Puts every camera, and that of browsers to come, where the seen side and the hands are in sight."""
        low, high = sight.cloud.min(axis=0), sight.cloud.max(axis=0)
        middle = (low + high) / 2 + np.array([0.0, 0.0, _ABOVE])
        across = np.cross([0.0, 0.0, 1.0], sight.forward)
        towards = -sight.forward - 0.75 * across + np.array([0.0, 0.0, 0.62])
        reach = _AROUND + float(np.linalg.norm(high - low)) / 2
        position = middle + towards / np.linalg.norm(towards) * reach / np.sin(FIELD_OF_VIEW / 2)
        initial = self._server.initial_camera
        initial.position, initial.look_at, initial.fov = position, middle, FIELD_OF_VIEW
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = position, middle

    def show_crowd(self, grasps: Grasps, indices: Sequence[int]) -> None:
        """One solid hand for each of `indices` of the grasps (world frame), coloured by probability.

        Hands that are drawn already stay as they are: all calls between two sights are for the same grasps.
        """
        for index in set(self._crowd) - set(indices):
            for handle in self._crowd.pop(index):
                handle.remove()
        for index in set(indices) - set(self._crowd):
            self._crowd[index] = self._add_hand(grasps, index)

    @property
    def crowd_size(self) -> int:
        """Number of hands that are drawn, without the one that moves."""
        return len(self._crowd)

    def hide_crowd(self, hidden: bool) -> None:
        """Takes the coloured hands out of sight while one of them moves, or puts them back."""
        for handle in itertools.chain.from_iterable(self._crowd.values()):
            handle.visible = not hidden

    def show_frame(self, frame: Frame) -> None:
        """One hand, in its own colours, and the object, at a moment of a motion."""
        poses = self._link_poses(frame.T_world_palm, frame.joints)
        with self._server.atomic():
            for link in self._links:
                _place(self._moving_link(link), poses[link])
            if self._object is not None and frame.T_world_object is not None:
                _place(self._object, frame.T_world_object)
            elif self._object is not None:
                self._object.visible = False

    def hide_frame(self) -> None:
        """Takes the moving hand away, and the object with it."""
        for handle in [*self._moving.values(), *([self._object] if self._object else [])]:
            handle.visible = False

    def _add_hand(self, grasps: Grasps, index: int) -> list[viser.MeshHandle]:
        """Fingers, and a palm that hides neither them nor the object, in the colour of the probability."""
        assert grasps.probability is not None
        T_world_palm = make_transform(grasps.rotation[index], grasps.position[index])
        poses = self._link_poses(T_world_palm, grasps.joints[index])
        color = _bytes(color_scale(grasps.probability[index : index + 1])[0])
        handles = []
        for name, opacity in (("palm", _PALM_OPACITY), ("fingers", None)):
            part = self._parts[name]
            rotation, position = poses[part.link, :3, :3], poses[part.link, :3, 3]
            vertices = np.einsum("vij,vj->vi", rotation, part.vertices) + position
            handle = self._scene.add_mesh_simple(
                f"/hands/{index}/{name}", vertices, part.faces, color=color, opacity=opacity
            )
            handle.on_click(lambda _: self._clicked(index))
            handles.append(handle)
        return handles

    def _moving_link(self, link: int) -> viser.MeshHandle:
        if link not in self._moving:
            mesh, color = self._meshes[link], _bytes(link_colors(self._hand)[link])
            self._moving[link] = self._scene.add_mesh_simple(
                f"/hand/{link}", mesh.vertices, mesh.faces, color=color
            )
        return self._moving[link]

    def _link_poses(
        self, T_world_palm: Float[np.ndarray, "4 4"], joints: Float[np.ndarray, " J"]
    ) -> Float[np.ndarray, "L 4 4"]:
        T_palm_link = self._hand.body_poses(torch.as_tensor(joints, dtype=torch.float64)[None])[0].numpy()
        return T_world_palm @ T_palm_link


def _join(meshes: dict[int, trimesh.Trimesh], links: Sequence[int]) -> _Part:
    chosen = [meshes[link] for link in links]
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in chosen)])
    return _Part(
        vertices=np.concatenate([mesh.vertices for mesh in chosen]),
        link=np.repeat(links, np.diff(first)),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(chosen, first, strict=False)]),
    )


def _place(handle: viser.MeshHandle, pose: Float[np.ndarray, "4 4"]) -> None:
    handle.wxyz, handle.position = quaternion_from_matrix(pose[:3, :3]), pose[:3, 3]
    handle.visible = True


def _light(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A mesh of few faces, split at sharp edges so that boxes keep flat sides and capsules look round."""
    if len(mesh.faces) > MAX_FACES:
        mesh = mesh.simplify_quadric_decimation(face_count=MAX_FACES)
    return mesh.smooth_shaded


def _bytes(color: Float[np.ndarray, " 3"]) -> tuple[int, int, int]:
    red, green, blue = (int(value) for value in np.rint(255 * color))
    return red, green, blue
