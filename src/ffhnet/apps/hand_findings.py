"""What is wrong with a hand, as far as it can be told without an object: for `ffhnet hand check`."""

from __future__ import annotations

from itertools import product

import mujoco
import numpy as np
import torch

from ffhnet.geometry.transforms import make_transform
from ffhnet.hands import Hand
from ffhnet.simulation.scene import PREFIX, build_scene

_CLOSURES = (0.0, 0.2, 0.4, 0.6)
"""How far the closing joints are between their limits, on the way on which fingers should meet."""

_WORLD = 1
"""Bit of objects and table."""


def findings(hand: Hand) -> list[str]:
    """What would make trials fail or mean something else, one line each; empty if nothing is found.

    Raises:
        ValueError: MuJoCo cannot read the model.
    """
    missing = _missing(hand, hand.spec().compile())
    return [*missing, *_turned(hand), *([] if missing else _touching(hand))]


def _missing(hand: Hand, model: mujoco.MjModel) -> list[str]:
    """Joints without a motor, and shapes that pass through objects."""
    actuators = {model.actuator(i).name for i in range(model.nu)}
    still = [name for name in hand.joint_names if name not in actuators]
    meets = (model.geom_conaffinity | model.geom_contype) & _WORLD
    ghosts = [model.geom(i).name or f"number {i}" for i in np.flatnonzero(meets == 0)]
    found = []
    if still:
        found.append(f"no position actuator has the name of {', '.join(still)}")
    if ghosts:
        found.append(f"objects pass through {', '.join(ghosts)}: contype or conaffinity must have bit 1")
    return found


def _turned(hand: Hand) -> list[str]:
    """A palm frame or closing directions that cannot be meant."""
    opened, way = hand.open(hand.eigengrasp_origin), hand.closing.moves * (hand.upper - hand.lower)
    tips = hand.fingertips(torch.as_tensor(opened + np.outer(_CLOSURES, way))).numpy()
    found = []
    if tips[0, :, 0].mean() <= 0:
        found.append("the open fingertips are behind the palm frame: x has to point to the object")
    thumb = np.array(["thumb" in site.name for site in hand.tree.sites])
    if thumb.any() and tips[0, thumb, 2].mean() >= tips[0, ~thumb, 2].mean():
        found.append("the thumb is on the side of +z: z has to point out of the back of the hand")
    spread = np.linalg.norm(tips - tips.mean(axis=1, keepdims=True), axis=2).mean(axis=1)
    if spread.argmin() == 0:
        found.append("closing takes the fingertips apart: a joint turns the other way")
    return found


def _touching(hand: Hand) -> list[str]:
    """Links that touch each other while the hand is open, which every trial would call a collision."""
    scene, pairs = build_scene(hand, None), set()
    far_from_table = make_transform(position=np.array([0.0, 0.0, 1.0]))
    for weights in product((0.0, 1.0), repeat=len(hand.eigengrasps)):
        joints = hand.eigengrasp_origin + np.array(weights) @ hand.eigengrasps
        scene.place_hand(far_from_table, hand.open(np.clip(joints, hand.lower, hand.upper)))
        mujoco.mj_forward(scene.model, scene.data)
        for pair in scene.data.contact.geom:
            pairs.add(tuple(sorted(scene.model.geom(i).name.removeprefix(PREFIX) for i in pair)))
    return [f"the open hand touches itself: {one} and {other}" for one, other in sorted(pairs)]
