"""Ranked grasps for what your depth camera sees.

python examples/01_your_own_cloud.py              a depth image of the repository
python examples/01_your_own_cloud.py scene.ply    your cloud: metres, x right, y down, z forward
"""

import sys
from pathlib import Path

import numpy as np

from ffhnet.feasibility.planner import Planner
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.capture import read_cloud, read_depth
from ffhnet.perception.observation import observe_depth, observe_scene

DEPTH = Path(__file__).parent / "data" / "jar_2000004_depth.png"


def main(cloud: str | None = None) -> None:
    # The table is found and removed; what stands on it is one object.
    rng = np.random.default_rng(0)
    if cloud is None:
        observation = observe_depth(read_depth(DEPTH), REALSENSE_D415, rng)
    else:
        observation = observe_scene(read_cloud(cloud), rng)

    network = FFHNet.from_pretrained()
    hand = load_hand(network.info.hand)
    # Sampled, ranked, and without those at which the hand would hit the table or what was seen.
    grasps = Planner(network, hand).plan(observation, num=400, seed=0).grasps
    assert grasps.probability is not None

    print(f"{len(grasps)} grasps in the {grasps.frame} frame, best first")
    print("probability", np.round(grasps.probability[:5], 3))
    print("palm position (m)", np.round(grasps.position[0], 3))
    print("approach direction", np.round(grasps.rotation[0][:, 0], 2))
    print("base of the hand (m)", np.round(hand.root_pose(grasps.rotation[0], grasps.position[0])[:3, 3], 3))
    for name, angle in zip(grasps.joint_names, grasps.joints[0], strict=True):
        print(f"  {name:18s} {angle:+.2f} rad")


if __name__ == "__main__":
    main(*sys.argv[1:2])
