"""From a mesh of your own to the best grasps, tried in physics (needs the extra `sim`).

python examples/02_your_own_objects.py              a skittle that is made here, in millimetres
python examples/02_your_own_objects.py my_meshes    a folder of .obj, .ply, .stl or .glb
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh

from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.objects.importing import BrokenMesh, import_mesh
from ffhnet.objects.layouts import find_meshes
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome
from ffhnet.simulation.views import ViewMaker

SKITTLE = [(0, 0), (20, 0), (28, 60), (12, 130), (17, 160), (10, 175), (0, 178)]
"""Radius and height of its outline, mm."""


def main(folder: Path) -> None:
    network = FFHNet.from_pretrained()
    for found in find_meshes(folder):
        # Checked, closed, in metres, split into convex pieces, with the poses in which it rests.
        mesh = import_mesh(found, scale="auto")
        if isinstance(mesh, BrokenMesh):
            print(f"{found.name}: {mesh.reason}")
            continue
        obj = mesh.obj
        print(f"{obj.name}: {len(obj.pieces)} convex pieces, {1000 * obj.mass:.0f} g")
        print(f"  rests {', '.join(obj.pose_names)}; graspable: {mesh.not_graspable or 'yes'}")

        # A simulated camera looks at it; grasps come in its frame and go to the world for the trial.
        T_world_object = obj.resting_poses[0]
        view = ViewMaker(obj, T_world_object).take(np.random.default_rng(0))
        best = network.grasp(view.observation)[:5].to_frame(view.T_world_camera, "world")
        results = GraspTrial(build_scene(load_hand(), obj)).run(best, T_world_object)
        assert best.probability is not None
        for probability, outcome, rise in zip(best.probability, results.outcome, results.rise, strict=True):
            word = Outcome(outcome).name.lower()
            print(f"  predicted {probability:.2f}   {word:9s} rose {100 * rise:4.1f} cm")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as place:
            trimesh.creation.revolve(np.array(SKITTLE)).export(Path(place) / "skittle.stl")
            main(Path(place))
