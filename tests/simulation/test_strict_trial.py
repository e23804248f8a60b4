"""The strict trial: what holds, what misses, what is pushed out, and the rules themselves."""

import dataclasses

import mujoco
import numpy as np
import pytest
import trimesh

from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.sampling.heuristic import POWER, sample_heuristic
from ffhnet.simulation import strict_trial as module
from ffhnet.simulation.strict_trial import PUSHES, StrictRules, StrictTrial, Verdict


def cylinder(radius=0.03, height=0.14, mass=0.3):
    mesh = trimesh.creation.cylinder(radius, height, sections=32)
    mesh.apply_translation([0, 0, height / 2])
    return GraspObject("cylinder", "can", mesh, (mesh,), mass, np.eye(4)[None], ("standing",))


@pytest.fixture(scope="module")
def hand():
    return load_hand()


@pytest.fixture(scope="module")
def trial(hand):
    return StrictTrial(hand, cylinder())


def side_grasp(hand, distance, height=0.075):
    """Palm x level towards the cylinder's axis, palm y up: fingers on one side, thumb on the other."""
    rotation = np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]]).T
    return Grasps(
        rotation=rotation[None],
        position=np.array([[distance, 0.0, height]]),
        joints=np.zeros((1, 15)),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
    )


@pytest.fixture(scope="module")
def mixed(hand, trial):
    """Free grasps of the can, of which some hold, some miss and some lose it."""
    mesh = cylinder().visual
    points, faces = trimesh.sample.sample_surface(mesh, 2000, seed=0)
    side = mesh.face_normals[faces][:, 2] > -0.5
    drawn = sample_heuristic(
        points[side], mesh.face_normals[faces][side], hand, 400, np.random.default_rng(1), POWER
    )
    return drawn[np.flatnonzero(trial.free(drawn, np.eye(4)))[:16]]


def test_a_wrap_around_a_can_holds(hand, trial):
    results = trial.run_strict(side_grasp(hand, 0.12), np.eye(4))
    assert results.held[0]
    assert results.push[0] == -1
    assert results.push_displacement[0] < 0.02
    assert results.push_angle[0] < np.radians(10)
    assert results.steps[0] > 6 * module.CHECK_PERIODS


def test_success_counts_from_before_the_hand_closed(hand, trial):
    """The hand holds the can, but has drawn it in by 5 cm: a success only where that much is allowed."""
    drawn_in = trial.run_strict(side_grasp(hand, 0.12), np.eye(4))
    assert drawn_in.closing_displacement[0] > 0.045
    assert drawn_in.displacement[0] >= drawn_in.closing_displacement[0]
    assert drawn_in.held[0]
    assert Verdict(drawn_in.verdict[0]) == Verdict.MOVED
    assert not drawn_in.success[0]
    generous = StrictTrial(hand, cylinder(), StrictRules(max_displacement=0.1, max_angle=np.pi))
    assert generous.run_strict(side_grasp(hand, 0.12), np.eye(4)).success[0]


def test_a_far_hand_misses_and_a_deep_one_collides(hand, trial):
    pair = Grasps.concatenate([side_grasp(hand, 0.40), side_grasp(hand, 0.02)])
    results = trial.run_strict(pair, np.eye(4))
    assert [Verdict(v) for v in results.verdict] == [Verdict.MISSED, Verdict.COLLISION]
    assert not results.held.any()
    assert results.steps[1] == 0


def test_a_strong_push_throws_the_object_out(hand):
    """One grasp under ever stronger pushes: it holds until one is too strong, and that one is named."""
    grasp = side_grasp(hand, 0.12)
    strengths = (10.0, 1000.0)
    weak, strong = (
        StrictTrial(hand, cylinder(), StrictRules(push=push)).run_strict(grasp, np.eye(4))
        for push in strengths
    )
    assert weak.held[0]
    assert not strong.held[0]
    assert strong.push[0] >= 0
    assert strong.push_displacement[0] > 0.05 or strong.push_angle[0] > np.radians(15)
    assert strong.steps[0] < 4 * weak.steps[0]


def test_a_slippery_object_is_pushed_out_along_its_axis(hand):
    """Without friction a can can only leave its wrap upwards or downwards: pushes four or five."""
    slippery = StrictTrial(hand, cylinder(), StrictRules(friction=(0.001, 0.00001, 0.0)))
    results = slippery.run_strict(side_grasp(hand, 0.11), np.eye(4))
    assert not results.held[0]
    assert results.push[0] < 0 or abs(PUSHES[results.push[0], 2]) == 1


def test_every_object_weighs_the_same(hand):
    for mass in (0.05, 3.0):
        trial = StrictTrial(hand, cylinder(mass=mass))
        assert trial._scene.model.body("object").mass[0] == pytest.approx(0.1)
        np.testing.assert_allclose(
            trial._scene.model.geom_friction[:, :2], [[0.6, 0.02]] * trial._scene.model.ngeom
        )
    light, heavy = (
        StrictTrial(hand, cylinder(mass=m)).run_strict(side_grasp(hand, 0.12), np.eye(4)) for m in (0.05, 3.0)
    )
    assert light.displacement == pytest.approx(heavy.displacement)


def test_the_nominal_push_throws_out_weak_grasps(trial, mixed):
    """Some grasps touch the can and lose it to a push of 1 N, in some direction and for a stated reason."""
    results = trial.run_strict(mixed, np.eye(4))
    thrown = results.push >= 0
    assert thrown.any()
    assert not results.held[thrown].any()
    far = (results.push_displacement >= 0.05) | (results.push_angle >= np.radians(15))
    np.testing.assert_array_equal(far, thrown)
    assert np.isin(results.verdict[thrown], [Verdict.MOVED, Verdict.TURNED]).all()


def test_order_and_company_do_not_change_results(hand, trial, mixed):
    together, backwards = trial.run_strict(mixed, np.eye(4)), trial.run_strict(mixed[::-1], np.eye(4))
    assert 0 < together.held.sum() < len(mixed)
    for field in dataclasses.fields(together):
        np.testing.assert_array_equal(getattr(together, field.name), getattr(backwards, field.name)[::-1])


def test_ending_pushes_at_rest_changes_no_verdict(trial, mixed, monkeypatch):
    early = trial.run_strict(mixed, np.eye(4))
    monkeypatch.setattr(module, "REST_SHARE", 0.0)
    full = trial.run_strict(mixed, np.eye(4))
    np.testing.assert_array_equal(early.held, full.held)
    np.testing.assert_array_equal(early.verdict, full.verdict)
    assert early.steps.sum() < full.steps.sum()


def test_neither_gravity_nor_table_during_the_pushes(hand, monkeypatch):
    """An object that nothing touches flies as far as Newton says, and does not turn."""
    trial = StrictTrial(hand, cylinder(), StrictRules(max_displacement=1e9, max_angle=1e9))
    trial._reset(np.eye(4))
    trial._scene.place_hand(hand.root_pose(np.eye(3), np.full(3, 50.0)), hand.open(np.zeros(15)))
    trial._leave_the_ground()
    mujoco.mj_forward(trial._scene.model, trial._scene.data)
    monkeypatch.setattr(module, "REST_SHARE", 0.0)
    row = trial._push_six_ways(trial._object_pose())
    assert row.push_displacement == pytest.approx(0.5 * 10.0 * 2.0**2, rel=0.02)
    assert row.push_angle < 1e-6


def test_floating_objects_have_no_table_to_lean_on(hand, trial):
    floating = StrictTrial(hand, cylinder(), StrictRules(closing="floating"))
    grasp = side_grasp(hand, 0.12)
    ours, theirs = trial.run_strict(grasp, np.eye(4)), floating.run_strict(grasp, np.eye(4))
    assert ours.held[0]
    assert theirs.held[0]
    assert ours.closing_displacement[0] != theirs.closing_displacement[0]
