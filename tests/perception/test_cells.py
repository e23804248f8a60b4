import numpy as np

from ffhnet.perception.cells import Cells


def some_points() -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.05, 0.05, (500, 3))


def test_cells_hold_their_points():
    points = some_points()
    cells = Cells.of(points, 0.02)
    index = ((points - cells.origin) / 0.02).astype(int)
    wanted = np.unique(np.ravel_multi_index(tuple(index.T), cells.shape), return_inverse=True)
    np.testing.assert_array_equal(np.sort(cells.occupied), wanted[0])
    np.testing.assert_array_equal(cells.occupied[cells.member], wanted[0][wanted[1]])
    np.testing.assert_array_equal(cells.member[cells.source], np.arange(len(cells.occupied)))
    np.testing.assert_array_equal(cells.number[cells.occupied], 1 + np.arange(len(cells.occupied)))
    assert np.count_nonzero(cells.number) == len(cells.occupied)


def test_steps_lead_to_the_cells_within_a_radius():
    cells = Cells.of(some_points(), 0.01, border=3)
    places = np.stack(np.unravel_index(cells.occupied, cells.shape), axis=1)
    steps = cells.steps(3.0)
    length = np.linalg.norm(
        np.stack(np.unravel_index(cells.occupied[0] + steps, cells.shape), axis=1) - places[0], axis=1
    )
    assert (np.diff(length) <= 0).all()
    near = cells.number[cells.occupied[0] + steps]
    wanted = np.flatnonzero(np.linalg.norm(places - places[0], axis=1) <= 3)
    np.testing.assert_array_equal(np.sort(near[near > 0]) - 1, wanted)
