from dataclasses import replace

import numpy as np
import pytest

from ffhnet.objects.convex import circle, rectangle, stack
from ffhnet.objects.inertia import inertia, piece_properties


def test_box_has_the_analytic_inertia():
    sides = np.array([0.04, 0.06, 0.1])
    section = rectangle(*sides[:2] / 2)
    volume, centre, tensor = piece_properties(stack([(0.0, section), (sides[2], section)]))
    assert volume == pytest.approx(np.prod(sides))
    np.testing.assert_allclose(centre, [0, 0, 0.05], atol=1e-12)
    squares = sides**2
    np.testing.assert_allclose(tensor, np.diag(volume / 12 * (squares.sum() - squares)), atol=1e-15)


def test_cylinder_comes_near_the_analytic_inertia():
    radius, height = 0.03, 0.12
    pieces = stack([(0.0, circle(radius)), (height, circle(radius))])
    volume, centre, tensor = piece_properties(pieces)
    assert volume == pytest.approx(np.pi * radius**2 * height, rel=0.01)
    np.testing.assert_allclose(centre, [0, 0, height / 2], atol=1e-12)
    across = volume * (3 * radius**2 + height**2) / 12
    np.testing.assert_allclose(np.diag(tensor), [across, across, volume * radius**2 / 2], rtol=0.015)


def test_mass_centre_and_inertia_agree_with_mujoco(one_per_family, compile_object):
    mujoco = pytest.importorskip("mujoco")
    for obj in one_per_family:
        model = compile_object(obj)
        mass, centre, tensor = inertia(obj)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.body_iquat[1])
        rotation = rotation.reshape(3, 3)
        expected = rotation @ np.diag(model.body_inertia[1]) @ rotation.T
        assert mass == pytest.approx(model.body_mass[1], rel=1e-6), obj.name
        np.testing.assert_allclose(centre, model.body_ipos[1], atol=1e-6, err_msg=obj.name)
        np.testing.assert_allclose(tensor, expected, atol=1e-4 * np.trace(expected), err_msg=obj.name)


def test_inertia_grows_with_the_mass(objects):
    obj = objects[0]
    heavy = inertia(replace(obj, mass=2 * obj.mass))
    np.testing.assert_allclose(heavy.inertia, 2 * inertia(obj).inertia)
    assert heavy.mass == 2 * obj.mass
