"""The generation job on two small objects: what is written, and that labels and frames are right."""

import dataclasses
import json

import numpy as np
import pytest
from executor_work import HereExecutor

from ffhnet.dataset.generate import generate
from ffhnet.dataset.object_trials import GenerateConfig, try_object
from ffhnet.dataset.records import pack, read_header, read_tables, read_training_data, trials_table
from ffhnet.dataset.statistics import summarise
from ffhnet.errors import DatasetError
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial

SOURCES = resolve_objects("procedural-test:2")
SMALL = GenerateConfig(
    placements=1, views=2, heuristic=4, power=4, perturb_rounds=1, perturb=6, max_collisions=3
)


def run(out):
    done = []
    assert generate(SOURCES, out, SMALL, HereExecutor(), done.append, print) == {}
    return done


@pytest.fixture(scope="module")
def data_set(tmp_path_factory):
    out = tmp_path_factory.mktemp("data") / "set"
    run(out)
    return out


def test_what_is_written(data_set):
    trials, views = read_tables(data_set, "trials"), read_tables(data_set, "views")
    assert set(trials["object"].to_pylist()) == {source.name for source in SOURCES}
    assert len(views) == 4
    proposer, outcome = np.array(trials["proposer"].to_pylist()), np.array(trials["outcome"].to_pylist())
    for name in ("heuristic", "power"):
        executed = (proposer == name) & (outcome != "collision")
        assert 0 < executed.sum() <= 8
    rise = trials["rise"].to_numpy()
    assert (rise[outcome == "success"] >= 0.15).all()
    assert (rise[outcome == "collision"] == 0).all()
    assert read_header(data_set)["hand"] == "dlr_hit_ii"


def test_repeats_are_stored_with_how_many_held():
    obj = SOURCES[0].load()
    blocks, _ = try_object(obj, dataclasses.replace(SMALL, repeated_share=1.0, repeats=3))
    table = trials_table(obj.name, blocks)
    repeats, held = table["repeats"].to_numpy(), table["held"].to_numpy()
    np.testing.assert_array_equal(repeats, np.concatenate([block.repeats for block in blocks]))
    np.testing.assert_array_equal(held, np.concatenate([block.held for block in blocks]))
    assert set(repeats) == {0, 3}
    assert 0 < held.sum() < repeats.sum()


def test_proposers_are_asked_again_only_where_too_few_grasps_held():
    obj = SOURCES[0].load()
    few, enough, none = (
        try_object(obj, dataclasses.replace(SMALL, rounds=3, enough=enough))[0] for enough in (10**6, 1, 0)
    )

    def asked(blocks):
        return sum(block.proposer == "power" for block in blocks)

    assert (asked(few), asked(none)) == (3, 1)
    held = np.cumsum([block.results.success.sum() for block in few])
    assert held[-1] > 0
    assert asked(enough) <= asked(few)
    # The first round is the same whether others follow or not.
    np.testing.assert_array_equal(few[0].grasps.position, none[0].grasps.position)


def test_finished_objects_are_left_alone(data_set):
    before = {path: path.stat().st_mtime_ns for path in data_set.rglob("*.parquet")}
    assert run(data_set) == []
    assert before == {path: path.stat().st_mtime_ns for path in data_set.rglob("*.parquet")}


def test_other_settings_are_refused(data_set):
    with pytest.raises(DatasetError, match="other settings"):
        generate(SOURCES, data_set, GenerateConfig(), HereExecutor(), print, print)


def test_stored_labels_come_again_from_physics(data_set):
    """Grasps read back from the file earn the labels that stand beside them."""
    data = read_training_data([data_set])
    obj = SOURCES[0].load()
    number = data.object_names.index(obj.name)
    mine = np.flatnonzero(data.placement_object[data.trial_placement] == number)
    from ffhnet.grasps import Grasps

    grasps = Grasps(
        rotation=data.rotation[mine],
        position=data.position[mine],
        joints=data.joints[mine],
        joint_names=data.joint_names,
        hand=data.hand,
        frame="world",
    )
    from ffhnet.hands import load_hand

    results = GraspTrial(build_scene(load_hand(), obj)).run(grasps, obj.resting_poses[0])
    np.testing.assert_array_equal(results.success, data.label[mine] > 0)
    np.testing.assert_array_equal(results.executed, data.executed[mine])


def test_views_and_grasps_share_the_world_frame(data_set):
    """Successful palms are within a hand's length of the centre of what the camera saw."""
    data = read_training_data([data_set])
    centre = data.T_world_view[:, :3, 3]
    for placement in range(data.num_placements):
        seen = centre[data.view_placement == placement].mean(axis=0)
        held = (data.trial_placement == placement) & data.success
        distance = np.linalg.norm(data.position[held] - seen, axis=1)
        assert (distance < 0.25).all()
    assert (data.table_height < 0).all()


def test_pack_keeps_everything(data_set, tmp_path):
    pack(data_set, tmp_path / "packed")
    packed, loose = read_training_data([tmp_path / "packed"]), read_training_data([data_set])
    np.testing.assert_array_equal(packed.position, loose.position)
    np.testing.assert_array_equal(packed.bps, loose.bps)
    assert summarise(tmp_path / "packed").rows == summarise(data_set).rows


def test_damaged_data_sets_are_named(tmp_path):
    with pytest.raises(DatasetError, match=r"dataset\.json"):
        read_training_data([tmp_path])
    (tmp_path / "dataset.json").write_text(
        json.dumps({"format": 2, "hand": "x", "joint_names": [], "closes": []})
    )
    with pytest.raises(DatasetError, match="holds no trials"):
        read_training_data([tmp_path])
    (tmp_path / "trials").mkdir()
    (tmp_path / "trials" / "a.parquet").write_bytes(b"PAR1 but no more")
    with pytest.raises(DatasetError, match="damaged"):
        read_training_data([tmp_path])
