"""`Observation`: one object as the networks see it, from a cloud, a scene or a depth image."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.errors import CloudError, OptionError, SceneError
from ffhnet.geometry.transforms import apply, invert
from ffhnet.perception.bps import encode
from ffhnet.perception.camera import Intrinsics
from ffhnet.perception.cloud import MIN_POINTS, depth_to_cloud, finite_rows, validate_cloud, validate_object
from ffhnet.perception.segment import MIN_HEIGHT, segment_objects
from ffhnet.perception.table import Plane, fit_table
from ffhnet.perception.view_frame import unit, view_frame

_CENTRED = 0.05
"""m: a cloud whose mean is nearer to the origin was centred; no camera sees an object so near."""

_AHEAD = 0.95
"""Least share of a scene's points that must lie in front of the camera, whichever way its z axis points."""

_BACKWARD = np.diag([1.0, -1.0, -1.0, 1.0])
"""Between camera axes with z forward and those of computer graphics: x right, y up, z backward."""

_LOWEST_PERCENT = 0.5
"""Percentile of the heights that counts as the object's lowest point: stray points lie lower."""

_CUT_BOTTOM = 0.008
"""m that removing the table takes off an object's bottom, so that the table lies below its lowest point."""


@dataclass(frozen=True)
class Observation:
    """One object from one view.

    Attributes:
        cloud: visible points of the object (m) in the input frame.
        frame: name of the input frame, "camera" or "world".
        T_input_view: pose of the view frame in the input frame.
        table_height: z of the table in the view frame in metres, a negative number.
        bps: basis point set encoding of the cloud in the view frame.
        plane: the table in the input frame, or None where it was not seen.
        scene: all that was observed (m) in the input frame, the object included, and only the object where
            it was cut out.
    """

    cloud: Float[np.ndarray, "N 3"]
    frame: str
    T_input_view: Float[np.ndarray, "4 4"]
    table_height: float
    bps: Float[np.ndarray, " 4096"]
    plane: Plane | None = None
    scene: Float[np.ndarray, "S 3"] = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def up(self) -> Float[np.ndarray, " 3"]:
        """Direction against gravity in the input frame."""
        return self.T_input_view[:3, 2]

    @property
    def cloud_view(self) -> Float[np.ndarray, "N 3"]:
        """The cloud (m) in the view frame."""
        return apply(invert(self.T_input_view), self.cloud)


def observe_object(
    cloud: Float[np.ndarray, "N 3"],
    up: Float[np.ndarray, " 3"],
    frame: str,
    viewing_direction: Float[np.ndarray, " 3"] | None = None,
    table_height: float | None = None,
) -> Observation:
    """An object that was already cut out of its scene.

    Args:
        cloud: the object's visible points (m); strays are dropped (`validate_object`).
        up: direction against gravity in the cloud's frame.
        frame: name of that frame, "camera" or "world".
        viewing_direction: from the camera to the object. If none: in the camera frame the direction to
            the cloud's mean, or the optical axis if the cloud was centred; in any other frame,
            where the camera is not known, +x.
        table_height: z of the table in the view frame, that is relative to the cloud's mean (m,
            negative). If none: the cloud's lowest point, which for clouds cut out above a plane is 5 to
            15 mm too high; pass the height where it is known.

    Raises:
        CloudError: the cloud cannot be used (`validate_object`).
        OptionError: a direction is not usable, or the table is above the cloud's mean.
    """
    cloud = validate_object(cloud)
    up = unit(up, "up direction")
    if viewing_direction is None:
        viewing_direction = _guess_viewing_direction(cloud, frame)
    T_input_view = view_frame(cloud, up, viewing_direction)
    if table_height is None:
        lowest = float(np.percentile((cloud - cloud.mean(axis=0)) @ up, _LOWEST_PERCENT))
        table_height = lowest - _CUT_BOTTOM
    if not table_height < 0:
        raise OptionError(f"the table must be below the cloud's mean (negative metres), got {table_height}")
    return _observation(cloud, frame, T_input_view, table_height, None, cloud)


def observe_scene(
    cloud_camera: Float[np.ndarray, "N 3"],
    rng: np.random.Generator,
    object_index: int = 0,
    mask: Bool[np.ndarray, " N"] | None = None,
) -> Observation:
    """An object in a scene with a table, in the camera frame (section III).

    Args:
        cloud_camera: the whole scene (m), camera at the origin; x right, y down, z forward, or as computer
            graphics has it: x right, y up, z backward.
        rng: source of randomness for RANSAC.
        object_index: which of the objects found, 0 = the main one.
        mask: which points are the object, if that is known; `object_index` is then not used.

    Raises:
        CloudError: the cloud cannot be used.
        SceneError: no table, no object, or not as many objects.
        OptionError: the mask does not fit the cloud.
    """
    cloud = validate_cloud(cloud_camera)
    if mask is not None:
        if np.shape(mask) != np.shape(cloud_camera)[:-1]:
            raise OptionError(
                f"the mask must have one value per point, got {np.shape(mask)} for {np.shape(cloud_camera)}"
            )
        rows = np.reshape(cloud_camera, (-1, np.shape(cloud_camera)[-1]))
        mask = np.ravel(mask).astype(bool)[finite_rows(rows)]
    return _observe_one(_Scene.of(cloud, rng), object_index, mask)


def observe_objects(cloud_camera: Float[np.ndarray, "N 3"], rng: np.random.Generator) -> list[Observation]:
    """All objects in a scene with a table, the main one first; otherwise as `observe_scene`."""
    scene = _Scene.of(validate_cloud(cloud_camera), rng)
    return [scene.observe(members) for members in scene.objects()]


@dataclass(frozen=True)
class _Scene:
    """A usable cloud and its table.

    Attributes:
        cloud: as it came in (m).
        optical: the same with z forward.
        T_input_optical: from there back to the input frame.
        plane: the table in the optical frame.
    """

    cloud: Float[np.ndarray, "N 3"]
    optical: Float[np.ndarray, "N 3"]
    T_input_optical: Float[np.ndarray, "4 4"]
    plane: Plane

    @classmethod
    def of(cls, cloud: Float[np.ndarray, "N 3"], rng: np.random.Generator) -> _Scene:
        ahead = np.count_nonzero(cloud[:, 2] > 0) / len(cloud)
        if 1 - _AHEAD < ahead < _AHEAD:
            raise CloudError(
                f"a scene must be in the camera's frame (z forward, or backward), but {100 * ahead:.0f} % of "
                "the points have z > 0; for an object already cut out give the up direction"
            )
        forward = ahead >= _AHEAD
        optical = cloud if forward else apply(_BACKWARD, cloud)
        return cls(cloud, optical, np.eye(4) if forward else _BACKWARD, fit_table(optical, rng))

    def objects(self) -> list[Int[np.ndarray, " M"]]:
        """Indices of the points of each object, the main one first."""
        return segment_objects(self.optical, self.plane)

    def observe(self, members: Int[np.ndarray, " M"]) -> Observation:
        """The object that some of the points are."""
        points, T = self.optical[members], self.T_input_optical
        T_optical_view = view_frame(points, self.plane.normal, points.mean(axis=0))
        table_height = -float(self.plane.height(T_optical_view[:3, 3]))
        plane = self.plane.to_frame(T)
        return _observation(
            self.cloud[members], "camera", T @ T_optical_view, table_height, plane, self.cloud
        )


def _observe_one(scene: _Scene, object_index: int, mask: Bool[np.ndarray, " N"] | None) -> Observation:
    """One object by its number or mask."""
    if mask is None:
        objects = scene.objects()
        if not 0 <= object_index < len(objects):
            raise SceneError(
                f"wanted object {object_index}, but the scene has {len(objects)} (counted from 0)"
            )
        return scene.observe(objects[object_index])
    members = np.flatnonzero(mask)
    members = members[scene.plane.height(scene.optical[members]) > MIN_HEIGHT]
    if len(members) < MIN_POINTS:
        raise SceneError(f"wanted {MIN_POINTS} points of the mask above the table, got {len(members)}")
    return scene.observe(members)


def observe_depth(
    depth: Float[np.ndarray, "H W"],
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    mask: Bool[np.ndarray, "H W"] | None = None,
    object_index: int = 0,
) -> Observation:
    """`observe_scene` of a depth image in metres (0 = no reading), with a mask in pixels."""
    cloud, pixels = depth_to_cloud(depth, intrinsics)
    if mask is not None and np.shape(mask) != np.shape(depth):
        raise OptionError(
            f"the mask must be of the depth image's size {np.shape(depth)}, got {np.shape(mask)}"
        )
    chosen = None if mask is None else np.ravel(mask).astype(bool)[pixels]
    if len(cloud) < MIN_POINTS:
        raise CloudError(f"a depth image must have at least {MIN_POINTS} readings, got {len(cloud)}")
    return _observe_one(_Scene.of(cloud, rng), object_index, chosen)


def _observation(
    cloud: Float[np.ndarray, "N 3"],
    frame: str,
    T_input_view: Float[np.ndarray, "4 4"],
    table_height: float,
    plane: Plane | None,
    scene: Float[np.ndarray, "S 3"],
) -> Observation:
    bps = encode(apply(invert(T_input_view), cloud))
    return Observation(cloud, frame, T_input_view, table_height, bps, plane, scene)


def _guess_viewing_direction(cloud: Float[np.ndarray, "N 3"], frame: str) -> Float[np.ndarray, " 3"]:
    """Where the camera probably looked: exact for clouds in the camera frame, else along +x."""
    if frame != "camera":
        return np.array([1.0, 0.0, 0.0])
    middle = cloud.mean(axis=0)
    return middle if np.linalg.norm(middle) > _CENTRED else np.array([0.0, 0.0, 1.0])
