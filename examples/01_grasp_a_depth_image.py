"""From a depth image to the best grasp, in Python: python examples/01_grasp_a_depth_image.py."""

from pathlib import Path

import numpy as np

from ffhnet.inference import FFHNet
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.capture import read_depth
from ffhnet.perception.observation import observe_depth

DEPTH = Path(__file__).parent / "data" / "jar_2000004_depth.png"


def main() -> None:
    network = FFHNet.from_pretrained()
    # The table is found and removed; what stands on it is one object.
    observation = observe_depth(read_depth(DEPTH), REALSENSE_D415, np.random.default_rng(0))
    grasps = network.grasp(observation, num=400, seed=0)
    assert grasps.probability is not None

    print(f"{len(grasps)} grasps in the {grasps.frame} frame, best first")
    print("probability", np.round(grasps.probability[:5], 3))
    print("palm position (m)", np.round(grasps.position[0], 3))
    print("approach direction", np.round(grasps.rotation[0][:, 0], 2))
    for name, angle in zip(grasps.joint_names, grasps.joints[0], strict=True):
        print(f"  {name:18s} {angle:+.2f} rad")


if __name__ == "__main__":
    main()
