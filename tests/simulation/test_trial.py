"""The trial: an obvious success, obvious failures, and what must not change a label."""

import dataclasses

import mujoco
import numpy as np
import pytest
import trimesh

from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.perception.raycast import RayScene
from ffhnet.sampling.heuristic import PAPER, POWER, sample_heuristic
from ffhnet.simulation import trial as trial_module
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import HAND, OBJECT, TABLE, build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome
from ffhnet.simulation.variation import held_under_variation


def cylinder(radius=0.03, height=0.14, mass=0.15):
    mesh = trimesh.creation.cylinder(radius, height, sections=32)
    mesh.apply_translation([0, 0, height / 2])
    return GraspObject("cylinder", "can", mesh, (mesh,), mass, np.eye(4)[None], ("standing",))


@pytest.fixture(scope="module")
def hand():
    return load_hand()


def side_grasp(hand, distance, height=0.075, joints=None):
    """Palm x level towards the cylinder's axis, palm y up: fingers on one side, thumb on the other."""
    rotation = np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]]).T
    return Grasps(
        rotation=rotation[None],
        position=np.array([[distance, 0.0, height]]),
        joints=np.zeros((1, 15)) if joints is None else joints[None],
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
    )


@pytest.fixture(scope="module")
def trial(hand):
    return GraspTrial(build_scene(hand, cylinder()))


def test_side_grasp_lifts_a_can(hand, trial):
    results = trial.run(side_grasp(hand, 0.12), np.eye(4))
    assert Outcome(results.outcome[0]) == Outcome.SUCCESS
    assert results.rise[0] > 0.17
    assert results.hold_slip[0] < 0.005
    assert results.contact_links[0] >= 3
    # Limits are soft contacts: a finger pressed against its limit goes a few degrees beyond.
    assert (results.closed_joints[0] >= hand.lower - 0.1).all()
    assert (results.closed_joints[0] <= hand.upper + 0.1).all()


@pytest.mark.parametrize(("distance", "held"), [(0.12, True), (0.40, False)])
def test_contacts_are_counted_by_owner_and_link(hand, trial, distance, held):
    trial.run(side_grasp(hand, distance), np.eye(4))
    scene = trial._scene
    geoms = scene.data.contact.geom
    owners = scene.geom_owner[geoms]
    by_hand = (owners == OBJECT).any(axis=1) & (owners == HAND).any(axis=1)
    links = set(scene.model.geom_bodyid[geoms[by_hand][owners[by_hand] == HAND]])
    on_table = (owners == [TABLE, OBJECT]).all(axis=1).any()
    assert trial._touching() == (len(links), on_table)
    assert (len(links) > 2, on_table) == (held, not held)
    assert trial._hand_touches() == (owners == HAND).any()


def test_far_hand_misses(hand, trial):
    results = trial.run(side_grasp(hand, 0.40), np.eye(4))
    assert Outcome(results.outcome[0]) == Outcome.MISSED
    assert results.contact_links[0] == 0
    assert results.pushed[0] < 1e-3


@pytest.mark.parametrize(("distance", "height"), [(0.02, 0.07), (0.12, 0.01)])
def test_hand_in_object_or_table_collides(hand, trial, distance, height):
    grasps = side_grasp(hand, distance, height)
    assert not trial.free(grasps, np.eye(4))[0]
    results = trial.run(grasps, np.eye(4))
    assert Outcome(results.outcome[0]) == Outcome.COLLISION
    assert not results.executed[0]


def test_palm_in_the_table_collides(hand):
    """The back of the hand lies 7 mm under the table top, the fingers 13 mm over it, far from the object."""
    trial = GraspTrial(build_scene(hand, cylinder(), Physics(approach_distance=0.0, approach_steps=1)))
    T_world_root = np.eye(4)
    T_world_root[:3, :3] = np.stack([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]], axis=1)
    T_world_root[:3, 3] = [0.5, 0.0, 0.03]
    palm = T_world_root @ hand.T_root_palm
    low = side_grasp(hand, 0.5).replace(rotation=palm[None, :3, :3], position=palm[None, :3, 3])
    assert not trial.free(low, np.eye(4))[0]
    # Found, but without force: the friction of these contacts is MuJoCo's, not the scene's.
    scene = trial._scene
    scene.place_hand(T_world_root, hand.open(low.joints[0]))
    mujoco.mj_forward(scene.model, scene.data)
    palm_on_table = (scene.geom_owner[scene.data.contact.geom] == [TABLE, HAND]).all(axis=1)
    assert palm_on_table.any()
    assert (scene.data.contact.efc_address[palm_on_table] == -1).all()
    assert trial.free(low.replace(position=low.position + np.array([0.0, 0.0, 0.01])), np.eye(4))[0]


def test_heavy_object_stays_on_the_table(hand):
    heavy = dataclasses.replace(cylinder(), mass=20.0)
    results = GraspTrial(build_scene(hand, heavy)).run(side_grasp(hand, 0.12), np.eye(4))
    assert Outcome(results.outcome[0]) == Outcome.SLIPPED
    assert results.rise[0] < 0.05


def test_slippery_object_is_not_lifted(hand):
    slippery = Physics(friction=(0.01, 0.0001, 0.0))
    results = GraspTrial(build_scene(hand, cylinder(), slippery)).run(side_grasp(hand, 0.12), np.eye(4))
    assert not results.success[0]


def test_an_object_in_the_closed_hand_that_still_stands_is_not_in_hand(hand):
    """The hand has closed and touches it, and so does the table."""
    trial, grasp = GraspTrial(build_scene(hand, cylinder(mass=20.0))), side_grasp(hand, 0.12)
    trial._reset(np.eye(4))
    trial._scene.place_hand(hand.root_pose(grasp.rotation[0], grasp.position[0]), hand.open(grasp.joints[0]))
    trial._close(grasp.joints[0])
    links, on_table = trial._touching()
    assert links > 0
    assert on_table
    assert not trial._in_hand()


def heuristic_grasps(hand, trial, count):
    mesh = cylinder().visual
    points, faces = trimesh.sample.sample_surface(mesh, 2000, seed=0)
    side = mesh.face_normals[faces][:, 2] > -0.5
    drawn = sample_heuristic(
        points[side], mesh.face_normals[faces][side], hand, 20 * count, np.random.default_rng(1), POWER
    )
    return drawn[np.flatnonzero(trial.free(drawn, np.eye(4)))[:count]]


def test_order_and_company_do_not_change_results(hand, trial):
    grasps = heuristic_grasps(hand, trial, 12)
    together = trial.run(grasps, np.eye(4))
    assert 0 < together.success.sum() < 12
    backwards = trial.run(grasps[::-1], np.eye(4))
    np.testing.assert_array_equal(together.outcome, backwards.outcome[::-1])
    np.testing.assert_array_equal(together.rise, backwards.rise[::-1])


def test_labels_agree_with_a_four_times_finer_step(hand, trial):
    grasps = heuristic_grasps(hand, trial, 24)
    fine = GraspTrial(build_scene(hand, cylinder(), Physics(timestep=0.001)))
    coarse = trial.run(grasps, np.eye(4)).success
    # A few per cent of grasps sit on the edge; more than 3 of 24 would be another physics.
    assert (coarse != fine.run(grasps, np.eye(4)).success).sum() <= 3


def test_labels_do_not_depend_on_where_the_world_is_turned(hand, trial):
    """The same scene turned about the vertical is the same trial, up to rounding."""
    grasps = heuristic_grasps(hand, trial, 12)
    turn = np.eye(4)
    turn[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    straight = trial.run(grasps, np.eye(4))
    turned = trial.run(grasps.to_frame(turn, "world"), turn)
    assert (straight.success != turned.success).sum() <= 1


def test_scene_has_the_stated_mass_friction_and_owners(hand):
    obj = cylinder(mass=0.123)
    scene = build_scene(hand, obj)
    assert scene.model.body("object").mass[0] == pytest.approx(0.123, rel=1e-6)
    np.testing.assert_allclose(scene.model.geom_friction, np.tile(Physics().friction, (scene.model.ngeom, 1)))
    assert (scene.geom_owner == HAND).sum() == len(hand.tree.geoms)
    assert (scene.geom_owner == OBJECT).sum() == 1
    assert (scene.geom_owner == TABLE).sum() == 1


def test_samplers_approach_the_surface(hand):
    """Without noise the paper's palm x is minus the normal and the palm lies in the stated range."""
    rng = np.random.default_rng(0)
    mesh = cylinder().visual
    points, faces = trimesh.sample.sample_surface(mesh, 500, seed=0)
    normals = mesh.face_normals[faces]
    quiet = dataclasses.replace(PAPER, position_noise=0.0, roll=0.0, pitch_yaw=0.0)
    grasps = sample_heuristic(points, normals, hand, 300, rng, quiet)
    ray = grasps.rotation[:, :, 0]
    distance = RayScene([mesh]).distances(grasps.position, ray)
    assert np.isfinite(distance).mean() > 0.99
    assert (distance[np.isfinite(distance)] < 0.115 + 1e-6).all()
    assert (distance[np.isfinite(distance)] > 0.045 - 1e-6).all()
    np.testing.assert_allclose(np.linalg.det(grasps.rotation), 1.0, atol=1e-9)
    side = np.abs(ray[:, 2]) < 0.1
    # Thumb side up: on the side of an upright can, palm y follows its axis, upwards.
    assert (grasps.rotation[side][:, 2, 1] > 0.9).all()


def test_margin_falls_towards_collision(hand, trial):
    """Free space gives 1, touching distance less, and a pose with full margin may be moved by 1 cm."""
    far, near = side_grasp(hand, 0.40, height=0.15), side_grasp(hand, 0.12)
    assert trial.run(far, np.eye(4)).margin[0] == 1.0
    assert 0 < trial.run(near, np.eye(4)).margin[0] < 1
    for shift in np.concatenate([np.eye(3), -np.eye(3)]):
        assert trial.free(far.replace(position=far.position + 0.01 * shift), np.eye(4))[0]


@pytest.fixture(scope="module")
def varied_grasps(hand):
    """Grasps around the can of which some hold, some slip and some miss."""
    rng = np.random.default_rng(3)
    cloud = np.asarray(trimesh.sample.sample_surface(cylinder().visual, 400, seed=1)[0])
    normals = cloud * [1, 1, 0] / np.linalg.norm(cloud[:, :2], axis=1, keepdims=True)
    drawn = Grasps.concatenate(
        [sample_heuristic(cloud, normals, hand, 300, rng, preset) for preset in (PAPER, POWER)]
    )
    free = GraspTrial(build_scene(hand, cylinder())).free(drawn, np.eye(4))
    return drawn[np.flatnonzero(free)[::3][:24]]


def test_ending_at_rest_changes_no_label(hand, varied_grasps, monkeypatch):
    early = GraspTrial(build_scene(hand, cylinder()))
    results = early.run(varied_grasps, np.eye(4))
    assert 0.1 < results.success.mean() < 0.9
    monkeypatch.setattr(trial_module, "REST_PERIODS", 10**9)
    full = GraspTrial(build_scene(hand, cylinder()))
    np.testing.assert_array_equal(full.run(varied_grasps, np.eye(4)).outcome, results.outcome)
    assert early.steps < full.steps


def test_simulating_the_free_way_of_the_fingers_changes_little(hand, varied_grasps, monkeypatch):
    """The start of the simulation shifts rounding, and so the labels of grasps on the edge, but no more."""
    trial = GraspTrial(build_scene(hand, cylinder()))
    skipped = trial.run(varied_grasps, np.eye(4))
    monkeypatch.setattr(GraspTrial, "_last_free", lambda self, path: 0)
    plain = trial.run(varied_grasps, np.eye(4))
    assert (plain.success != skipped.success).sum() <= 1
    assert ((plain.contact_links > 0) != (skipped.contact_links > 0)).sum() <= 1
    # What misses ends with the same closed hand, found by sweeping or by simulation.
    missed = (plain.outcome == Outcome.MISSED) & (skipped.outcome == Outcome.MISSED)
    assert missed.any()
    np.testing.assert_allclose(skipped.closed_joints[missed], plain.closed_joints[missed], atol=0.1)


def test_varied_worlds_and_back(hand, varied_grasps):
    trial = GraspTrial(build_scene(hand, cylinder()))
    nominal = trial.run(varied_grasps, np.eye(4)).success
    trial.vary(mass=1.0, friction=0.05)
    assert trial.run(varied_grasps, np.eye(4)).success.sum() < nominal.sum()
    trial.vary(mass=100.0)
    assert not trial.run(varied_grasps, np.eye(4)).success.any()
    trial.vary()
    np.testing.assert_array_equal(trial.run(varied_grasps, np.eye(4)).success, nominal)


def test_repeats_tell_a_firm_grasp_from_a_miss(hand):
    trial = GraspTrial(build_scene(hand, cylinder()))
    pair = Grasps.concatenate([side_grasp(hand, 0.13, height=0.08), side_grasp(hand, 0.40)])
    rng = np.random.default_rng(0)
    held = held_under_variation(trial, pair, np.eye(4), 6, rng)
    assert held[0] >= 4
    assert held[1] == 0
    # Afterwards the world is nominal again.
    assert trial.run(side_grasp(hand, 0.12), np.eye(4)).success[0]
