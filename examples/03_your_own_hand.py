"""Your own hand: its joints, a picture, and first grasps in physics (needs the extra `sim`).

python examples/03_your_own_hand.py                    two fingers and a thumb, in examples/data/three_fingers
python examples/03_your_own_hand.py my_hand/hand.toml  yours, or the name of a hand of the package
"""

import sys
from pathlib import Path

import numpy as np
import torch

from ffhnet.evaluation.sheets import hand_picture
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.sampling.heuristic import sample_heuristic
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome
from ffhnet.simulation.views import ViewMaker

THREE_FINGERS = Path(__file__).parent / "data" / "three_fingers" / "hand.toml"
TRIED = 20


def main(name_or_toml: str = str(THREE_FINGERS), out: Path = Path("out")) -> None:
    hand = load_hand(name_or_toml)
    for name, lower, upper in zip(
        hand.joint_names, np.degrees(hand.lower), np.degrees(hand.upper), strict=True
    ):
        print(f"{name:18s} {lower:6.1f} to {upper:5.1f} degrees")
    open_hand = torch.as_tensor(hand.open(hand.eigengrasp_origin))[None]
    for site, tip in zip(hand.tree.sites, hand.fingertips(open_hand)[0].numpy(), strict=True):
        print(f"{site.name:18s} at {tip.round(3)} m of the palm frame, open")
    out.mkdir(exist_ok=True)
    hand_picture(hand, out / "hand.png")
    print(f"look at {out / 'hand.png'}: x has to be the way to the object, y the side of the thumb")

    # One object as a camera sees it, grasps from points and normals, and what becomes of them.
    obj = resolve_objects("jar_2000004")[0].load()
    T_world_object, rng = obj.resting_poses[0], np.random.default_rng(0)
    cloud, normals = ViewMaker(obj, T_world_object).take(rng).cloud_and_normals_world
    grasps = sample_heuristic(cloud, normals, hand, 30 * TRIED, rng)
    trial = GraspTrial(build_scene(hand, obj))
    free = np.flatnonzero(trial.free(grasps, T_world_object))
    print(f"{obj.name}: the open hand reaches {len(free)} of {len(grasps)} sampled grasps")
    results = trial.run(grasps[free[:TRIED]], T_world_object)
    for outcome in Outcome:
        if count := int((results.outcome == outcome).sum()):
            print(f"  {outcome.name.lower()}: {count}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
