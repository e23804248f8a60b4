"""Scenes with the arm: objects stand apart, a scene repeats itself, and what is counted is what happened."""

import json

import numpy as np
import pytest

pytest.importorskip("frankik", reason="needs the extra arm")

from ffhnet.evaluation.arm import ArmOutcome, ArmProtocol, _place, arm_jobs, evaluate_scene
from ffhnet.evaluation.arm_table import results, shares, to_json
from ffhnet.geometry.transforms import apply
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.simulation.panda.execution import Execution
from ffhnet.simulation.trial import Outcome


def test_objects_stand_apart_on_the_table():
    objects = [source.load() for source in resolve_objects("procedural-test:4")]
    corners = [
        apply(pose, obj.visual.vertices) for obj, pose in zip(objects, _place(objects, rng()), strict=True)
    ]
    for i, one in enumerate(corners):
        assert abs(one[:, 2].min()) < 2e-3
        for other in corners[:i]:
            assert np.linalg.norm(one[:, None, :2] - other[None, :, :2], axis=2).min() > 0.015


def rng():
    return np.random.default_rng(0)


def test_a_scene_is_planned_and_executed():
    jobs = arm_jobs(resolve_objects("procedural-test:9")[7:], ArmProtocol(neighbours=1, samples=100))
    assert [len(job.sources) for job in jobs] == [2, 2]
    outcome = evaluate_scene(jobs[0])
    assert outcome.sampled >= 100
    assert outcome.execution is not None
    assert outcome.base_error < 0.005
    assert sum(outcome.reasons.values()) < outcome.sampled


def test_contacts_come_before_the_lift():
    def scene(**flags):
        clear = {"table": False, "object": False, "neighbour": False, "arm": False}
        done = Execution(outcome=Outcome.SUCCESS, **(clear | flags), rise=0.2, moved=0.0)
        return ArmOutcome(("a",), 0.0, 400, 300, {"object": 100}, 0.001, done)

    outcomes = [scene(), scene(object=True), scene(table=True), scene(arm=True), ArmOutcome(("b",), 0.0)]
    assert results(outcomes) == {"success": 2, "touched table": 1, "arm touched": 1, "no object seen": 1}
    first, of_done, no_table, *_ = shares(outcomes)
    assert (first.count, first.total) == (2, 5)
    assert (of_done.count, of_done.total) == (2, 4)
    assert (no_table.count, no_table.total) == (3, 4)
    assert len(json.loads(to_json(outcomes, {}))["scenes"]) == 5
