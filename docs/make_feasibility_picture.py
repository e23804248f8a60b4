"""Makes `images/feasibility.png`: grasps among three objects that are kept, and dropped for each reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont

from ffhnet.evaluation.render import Surface, camera_around, render, square_camera
from ffhnet.evaluation.shapes import hand_surfaces
from ffhnet.feasibility.hand_check import HandCheck
from ffhnet.feasibility.reasons import Reason
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.observation import observe_depth
from ffhnet.perception.sensor_noise import StereoNoise

FILE = Path(__file__).parent / "images" / "feasibility.png"
NAMES = ("detergent_2000009", "can_2000010", "spray_flask_2000005")
PLACES = ((0.0, 0.0), (-0.03, 0.13), (0.11, -0.08))
COLORS = ((0.93, 0.60, 0.24), (0.50, 0.70, 0.50), (0.50, 0.60, 0.80))
SHOWN = (Reason.FEASIBLE, Reason.FEASIBLE, Reason.TABLE, Reason.OBJECT, Reason.SCENE, Reason.APPROACH)
SIZE, COLUMNS = 380, 3


def main() -> None:
    """Look, sample, check, and draw one panel for each reason."""
    rng = np.random.default_rng(4)
    hand, network = load_hand(), FFHNet.from_pretrained(device="cpu")
    meshes = []
    for name, place in zip(NAMES, PLACES, strict=True):
        obj = resolve_objects(name)[0].load()
        meshes.append(obj.visual.copy().apply_transform(obj.resting_poses[0]).apply_translation([*place, 0]))
    T_world_camera = look_at([-0.45, -0.35, 0.5], [0, 0, 0.05])
    depth = render_depth(meshes, T_world_camera, REALSENSE_D415)
    observation = observe_depth(StereoNoise().apply(depth, REALSENSE_D415, rng), REALSENSE_D415, rng)
    samples = network.grasp(observation)
    # The network hardly ever reaches into the table; shaken samples do.
    turn = matrix_from_rotation_vector(0.4 * rng.normal(size=(len(samples), 3)))
    moved = samples.position + 0.03 * rng.normal(size=(len(samples), 3))
    grasps = Grasps.concatenate([samples, samples.replace(position=moved, rotation=samples.rotation @ turn)])
    check = HandCheck(hand)
    reasons = check(grasps, check.look(observation))
    table = trimesh.creation.box([0.6, 0.6, 0.002]).apply_translation([0, 0, -0.001])
    scene = [Surface(mesh, np.array(color)) for mesh, color in zip(meshes, COLORS, strict=True)]
    scene.append(Surface(table, np.array([0.85, 0.85, 0.85])))
    sheet = Image.new("RGB", (COLUMNS * SIZE, -(-len(SHOWN) // COLUMNS) * SIZE))
    shown: list[int] = []
    for place, reason in enumerate(SHOWN):
        best = next(int(i) for i in np.flatnonzero(reasons == reason)[::7] if i not in shown)
        shown.append(best)
        grasp = grasps[best].to_frame(T_world_camera, "world")
        pose = make_transform(grasp.rotation[0], grasp.position[0])
        surfaces = [*scene, *hand_surfaces(hand, hand.open(grasp.joints[0]), pose)]
        points = np.concatenate([*(mesh.vertices for mesh in meshes), grasp.position])
        camera = square_camera(SIZE)
        panel = Image.fromarray(
            render(surfaces, camera_around(points, 40.0, 30.0, camera, margin=1.5), camera)
        )
        ImageDraw.Draw(panel).text((10, 8), reason.word, fill=(28, 34, 44), font=ImageFont.load_default(18))
        sheet.paste(panel, (place % COLUMNS * SIZE, place // COLUMNS * SIZE))
    sheet.save(FILE, optimize=True)


if __name__ == "__main__":
    main()
