"""`ffhnet hand`: check a hand's description before it is used."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ffhnet.apps.console import absent, busy, print_table
from ffhnet.errors import HandError

if TYPE_CHECKING:
    from ffhnet.hands import Hand

_AGREEMENT = 1e-6
"""m and entries of rotation matrices: by how much our kinematics and MuJoCo's may differ."""


@dataclass(frozen=True)
class HandOptions:
    """Check a hand: read it, compare it with MuJoCo, and show its joints."""

    action: Annotated[Literal["check"], tyro.conf.Positional]
    """What to do."""
    hand: Annotated[str, tyro.conf.Positional]
    """Name of a built-in hand, or a .toml file."""
    plot: Annotated[Path | None, absent("FILE")] = None
    """Write a picture of the hand with its palm frame to this .png."""


def run(options: HandOptions) -> None:
    """Check; raises HandError where the hand cannot be used."""
    from ffhnet.files import check_output

    if options.plot is not None:
        check_output(options.plot, (".png",))
    with busy("checking"):
        from ffhnet.hands import load_hand

        hand = load_hand(options.hand)
        _check_shapes(hand)
        _check_eigengrasps(hand)
        compared = _compare_with_mujoco(hand)
        found = _find(hand) if compared else []
    _show(hand)
    print("kinematics agree with MuJoCo" if compared else "MuJoCo is not installed: kinematics not compared")
    for finding in found:
        print(f"to be mended: {finding}")
    if options.plot is not None:
        with busy("drawing"):
            from ffhnet.evaluation.sheets import hand_picture

            hand_picture(hand, options.plot)
        print(f"picture written to {options.plot}")


def _check_shapes(hand: Hand) -> None:
    if not hand.tree.geoms:
        raise HandError(f"hand '{hand.name}' has no collision geoms")
    if not hand.tree.sites:
        raise HandError(f"hand '{hand.name}' has no fingertip sites")


def _check_eigengrasps(hand: Hand) -> None:
    """Weights 0 and 1 of every direction must stay within the limits, as the sampler uses them."""
    import numpy as np

    corners = np.stack([hand.eigengrasp_origin, hand.eigengrasp_origin + hand.eigengrasps.sum(axis=0)])
    for corner, name in zip(corners, ("origin", "full weights"), strict=True):
        outside = np.flatnonzero((corner < hand.lower - 1e-3) | (corner > hand.upper + 1e-3))
        if len(outside):
            joint = outside[0]
            raise HandError(
                f"the eigengrasps' {name} put {hand.joint_names[joint]} at {corner[joint]:.3f} rad, "
                f"wanted {hand.lower[joint]:.3f} to {hand.upper[joint]:.3f}"
            )


def _compare_with_mujoco(hand: Hand) -> bool:
    """Whether MuJoCo was there to compare with; raises HandError where it disagrees."""
    try:
        import mujoco
    except ImportError:
        return False
    import numpy as np
    import torch

    try:
        model = hand.spec().compile()
    except ValueError as error:
        raise HandError(f"MuJoCo cannot read {hand.mjcf.name}: {error}") from error
    joints = hand.lower + 0.4 * (hand.upper - hand.lower)
    angles = dict(zip(hand.joint_names, joints, strict=True))
    for coupling in hand.tree.couplings:
        angles[coupling.follower] = np.polynomial.polynomial.polyval(
            angles[coupling.leader], coupling.coefficients
        )
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.joint(name).qpos = angle
    mujoco.mj_kinematics(model, data)
    ours = hand.tree.body_poses(torch.as_tensor(joints)[None], hand.joint_names)[0].numpy()
    if model.nbody != 1 + len(hand.tree.bodies):
        raise HandError(f"MuJoCo finds {model.nbody - 1} bodies in {hand.mjcf.name}, ffhnet {len(ours)}")
    # Both read the bodies in the order of the file; body 0 is the world.
    for index, (body, pose) in enumerate(zip(hand.tree.bodies, ours, strict=True), start=1):
        theirs = data.body(index)
        rotation = theirs.xmat.reshape(3, 3)
        if max(np.abs(pose[:3, 3] - theirs.xpos).max(), np.abs(pose[:3, :3] - rotation).max()) > _AGREEMENT:
            raise HandError(f"MuJoCo places body '{body.name}' elsewhere than ffhnet reads it")
    return True


def _find(hand: Hand) -> list[str]:
    from ffhnet.apps.hand_findings import findings

    return findings(hand)


def _show(hand: Hand) -> None:
    import numpy as np

    degrees = np.degrees(np.stack([hand.lower, hand.upper, hand.eigengrasp_origin], axis=1))
    rows = [
        [name, *(f"{value:.1f}" for value in row), "closes" if moves else "holds"]
        for name, row, moves in zip(hand.joint_names, degrees, hand.closing.moves, strict=True)
    ]
    followers = ", ".join(
        f"{coupling.follower} follows {coupling.leader}" for coupling in hand.tree.couplings
    )
    print_table(
        f"{hand.name}: {hand.num_joints} joints, {len(hand.tree.sites)} fingertips",
        ["joint", "lower (°)", "upper (°)", "eigengrasp origin (°)", "when closing"],
        rows,
    )
    if followers:
        print(f"coupled: {followers}")
