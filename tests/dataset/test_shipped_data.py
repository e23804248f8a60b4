"""The data sets in the repository: their grasps, tried again, earn the outcomes that stand beside them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from ffhnet.dataset.columns import read_trial_columns
from ffhnet.dataset.records import read_header
from ffhnet.geometry.rotations import matrix_from_quaternion
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome

DATA = Path(__file__).parents[2] / "data"
EVERY = 6
"""Of the trials on an object one in so many is tried again."""


@pytest.mark.parametrize(
    ("folder", "name"),
    [("val0", "bottle_1000003"), ("train5", "aircraft_3000147"), ("train7", "basket_3000802")],
)
def test_outcomes_come_again_with_the_recorded_physics(folder, name):
    generation = read_header(DATA / folder)["generation"]
    hand = load_hand(generation["hand"])
    hand = dataclasses.replace(hand, closing=dataclasses.replace(hand.closing, **generation["closing"]))
    settings = generation["physics"]
    physics = Physics(**{**settings, "friction": tuple(settings["friction"])})
    trials = read_trial_columns([DATA / folder])
    trials = trials[(trials.object_name == name) & (trials.placement == 0)][::EVERY]
    grasps = Grasps(
        rotation=matrix_from_quaternion(trials.quaternion_wxyz),
        position=trials.position,
        joints=trials.joints,
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
    )
    obj = resolve_objects(name)[0].load()
    results = GraspTrial(build_scene(hand, obj, physics)).run(grasps, obj.resting_poses[0])
    assert len(set(trials.outcome)) > 1
    assert [Outcome(outcome).name.lower() for outcome in results.outcome] == list(trials.outcome)
    np.testing.assert_array_equal(results.contact_links, trials.contact_links)
