"""The data set: count it, look at one object, try stored grasps again (needs the extra `sim`).

python examples/05_read_the_data.py                 the validation part
python examples/05_read_the_data.py data/train0     any other part, or one of your own
"""

import sys
from pathlib import Path

import numpy as np

from ffhnet.dataset.records import read_training_data
from ffhnet.geometry.transforms import invert
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.objects.procedural import make_object, seed_of
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial

DATA = Path(__file__).parents[1] / "data" / "val0"


def main(folder: Path = DATA) -> None:
    data = read_training_data([folder])
    print(f"{data.hand}: {len(data.object_names)} objects, {data.num_views} views, {data.num_trials} trials")
    tried, held = int(data.executed.sum()), int(data.success.sum())
    print(f"{tried} could be executed, {held} held: {held / tried:.1%}")

    # A name holds the seed of its object, so that the whole object comes back.
    name = data.object_names[0]
    obj = make_object(seed_of(name))
    one = data.select_objects([name])
    print(f"{name}: {1000 * obj.mass:.0f} g, {one.num_placements} placements, {one.num_trials} trials")
    encoded = one.bps[0].astype(float)
    print(f"  its first view: {len(encoded)} distances of {encoded.min():.3f} to {encoded.max():.3f} m")

    # A grasp belongs to a placement and is stored in the world; networks see it in the frame of a view.
    trials = np.flatnonzero((one.trial_placement == 0) & one.executed)[:5]
    grasps = Grasps(
        rotation=one.rotation[trials],
        position=one.position[trials],
        joints=one.joints[trials],
        joint_names=one.joint_names,
        hand=one.hand,
        frame="world",
    )
    first = grasps.to_frame(invert(one.T_world_view[0]), "view").position[0]
    print(f"  first palm: {grasps.position[0].round(3)} m in the world, {first.round(3)} m in its first view")
    results = GraspTrial(build_scene(load_hand(one.hand), obj)).run(grasps, obj.resting_poses[0])
    print(f"  stored labels {one.label[trials].astype(int)}, tried again {results.success.astype(int)}")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
