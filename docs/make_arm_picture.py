"""Renders docs/images/arm_grasp.png. Run it from the repository root: python docs/make_arm_picture.py."""

from pathlib import Path

import mujoco
import numpy as np
import trimesh
from PIL import Image

from ffhnet.evaluation.picture import save_png
from ffhnet.evaluation.render import Surface, camera_around, render, square_camera
from ffhnet.evaluation.shapes import PALM, hand_surfaces
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.procedural import make_object
from ffhnet.sampling.heuristic import POWER, sample_heuristic
from ffhnet.simulation.panda.scene import ArmScene, build_arm_scene
from ffhnet.simulation.panda.trial import ArmTrial
from ffhnet.simulation.scene import ARM
from ffhnet.simulation.views import ViewMaker

PATH = Path(__file__).parent / "images" / "arm_grasp.png"
OBJECT_COLOR = np.array([0.85, 0.48, 0.20])
ARM_COLORS = (np.array([0.90, 0.91, 0.92]), PALM + 0.25)


def arm_surfaces(scene: ArmScene) -> list[Surface]:
    """The arm's collision capsules where they stand, links in two alternating colours."""
    surfaces = []
    for geom in np.flatnonzero(scene.geom_owner == ARM):
        radius, half = scene.model.geom_size[geom, :2]
        capsule = trimesh.creation.capsule(radius=radius, height=2 * half, count=[32, 32])
        capsule.apply_translation(-capsule.bounds.mean(axis=0))
        pose = make_transform(scene.data.geom_xmat[geom].reshape(3, 3), scene.data.geom_xpos[geom])
        color = ARM_COLORS[scene.model.geom_bodyid[geom] % 2]
        surfaces.append(Surface(capsule.smooth_shaded.apply_transform(pose), color))
    return surfaces


def successful_grasp(obj: GraspObject, trial: ArmTrial) -> tuple[Grasps, np.ndarray]:
    """The first power grasp that lifts the object, and the joint angles in which the hand holds it."""
    rng = np.random.default_rng(4)
    cloud, normals = ViewMaker(obj, obj.resting_poses[0]).take(rng).cloud_and_normals_world
    drawn = sample_heuristic(cloud, normals, trial.hand, 300, rng, POWER)
    grasps = drawn[np.flatnonzero(trial.free(drawn, obj.resting_poses[0]))]
    for i in range(len(grasps)):
        results = trial.run(grasps[i], obj.resting_poses[0])
        if results.success[0]:
            return grasps[i], results.closed_joints[0]
    raise RuntimeError("no grasp of this draw holds the object")


def main() -> None:
    """A household object in the hand on the arm."""
    hand, obj = load_hand(), make_object(2_000_005)
    scene = build_arm_scene(hand, obj)
    trial = ArmTrial(scene)
    grasp, closed = successful_grasp(obj, trial)
    # The trial left the arm on top of the lift; for the picture it goes back to where the fingers closed.
    T_world_palm = make_transform(grasp.rotation[0], grasp.position[0])
    scene.place_hand(hand.root_pose(grasp.rotation[0], grasp.position[0]), closed)
    mujoco.mj_kinematics(scene.model, scene.data)
    visual = obj.visual.copy().apply_transform(obj.resting_poses[0])
    surfaces = [
        *arm_surfaces(scene),
        *hand_surfaces(hand, np.clip(closed, hand.lower, hand.upper), T_world_palm),
        Surface(visual, OBJECT_COLOR),
    ]
    points = np.concatenate([surface.mesh.vertices for surface in surfaces])
    camera = square_camera(560)
    T_world_camera = camera_around(points, -70.0, 18.0, camera)
    save_png(Image.fromarray(render(surfaces, T_world_camera, camera, ground=0.0)), PATH)


if __name__ == "__main__":
    main()
