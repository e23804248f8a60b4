"""Shared: the first objects of the training split, and MuJoCo models of an object's pieces."""

from collections.abc import Callable

import numpy as np
import pytest

from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.procedural import make_object


@pytest.fixture(scope="session")
def objects() -> list[GraspObject]:
    return [make_object(seed) for seed in range(500)]


@pytest.fixture(scope="session")
def one_per_family(objects) -> list[GraspObject]:
    return list({obj.family: obj for obj in objects}.values())


@pytest.fixture(scope="session")
def compile_object() -> Callable:
    """Free body of an object's pieces as convex mesh geoms above a plane."""
    mujoco = pytest.importorskip("mujoco", reason="the extra `sim` is not installed")

    def build(obj: GraspObject, friction: float = 0.8):
        spec = mujoco.MjSpec()
        spec.option.timestep = 0.002
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10
        sliding = [friction, 0.005, 0.0001]
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1], friction=sliding, condim=4
        )
        body = spec.worldbody.add_body(name="object")
        body.add_freejoint()
        density = obj.mass / sum(piece.volume for piece in obj.pieces)
        for k, piece in enumerate(obj.pieces):
            spec.add_mesh(
                name=f"piece_{k}",
                uservert=piece.vertices.ravel(),
                userface=piece.faces.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT,
            )
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=f"piece_{k}",
                density=density,
                friction=sliding,
                condim=4,
                solref=[0.005, 1],
                contype=2,
                conaffinity=1,
            )
        return spec.compile()

    return build


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)
