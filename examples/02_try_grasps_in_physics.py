"""See whether the ten best grasps lift an object that no network was trained on.

python examples/02_try_grasps_in_physics.py        (needs the extra `sim`)
"""

import numpy as np

from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.objects.procedural import make_object, split_seeds
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome
from ffhnet.simulation.views import ViewMaker


def main() -> None:
    network = FFHNet.from_pretrained()
    seed = split_seeds("procedural-test", 10)[5]
    obj = make_object(seed)
    T_world_object = obj.resting_poses[0]

    # A simulated camera looks at the object; grasps come in its frame and go to the world for the trial.
    view = ViewMaker(obj, T_world_object).take(np.random.default_rng(seed))
    best = network.grasp(view.observation)[:10].to_frame(view.T_world_camera, "world")
    results = GraspTrial(build_scene(load_hand(), obj)).run(best, T_world_object)

    assert best.probability is not None
    print(f"{obj.name}, {1000 * obj.mass:.0f} g")
    for probability, outcome, rise in zip(best.probability, results.outcome, results.rise, strict=True):
        print(f"predicted {probability:.2f}   {Outcome(outcome).name.lower():9s} rose {100 * rise:4.1f} cm")


if __name__ == "__main__":
    main()
