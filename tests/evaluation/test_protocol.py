"""In which poses objects are looked at."""

import numpy as np
import pytest

from ffhnet.evaluation.protocol import pose_of_view


@pytest.mark.parametrize("placements", [1, 2, 3, 4, 10, 25])
@pytest.mark.parametrize("num_poses", [2, 3, 4])
def test_at_least_a_third_of_the_views_in_other_poses(placements, num_poses):
    poses = [pose_of_view(k, placements, num_poses, "all") for k in range(placements)]
    others = [pose for pose in poses if pose > 0]
    assert placements / 3 <= len(others) < placements / 3 + 1
    assert poses == sorted(poses, key=lambda pose: pose > 0)
    used = np.bincount(others, minlength=num_poses)[1:]
    assert used.max() - used.min() <= 1


def test_one_pose_only():
    assert [pose_of_view(k, 5, 1, "all") for k in range(5)] == [0] * 5
    assert [pose_of_view(k, 5, 3, "standing") for k in range(5)] == [0] * 5
