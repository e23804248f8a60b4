"""Which stable grasps are different ones: counting successes alone would count one grasp a hundred times."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

NEAR_POSITION = 0.02
"""m between palms, up to which grasps can be the same."""

NEAR_ANGLE = np.radians(20.0)
"""rad between palms, likewise."""

NEAR_JOINTS = 0.3
"""rad, root mean square over the closed joints, likewise."""


def is_distinct(
    position: Float[np.ndarray, "N 3"], rotation: Float[np.ndarray, "N 3 3"], joints: Float[np.ndarray, "N J"]
) -> Bool[np.ndarray, " N"]:
    """Which grasps of one placement are not within all three `NEAR_...` of an earlier distinct one.

    Greedy in the given order, so the count among the first n does not depend on what follows.
    """
    n = len(position)
    distinct = np.zeros(n, dtype=bool)
    least_trace = 1 + 2 * np.cos(NEAR_ANGLE)
    flat = rotation.reshape(n, 9)
    kept = np.empty(n, dtype=int)
    count = 0
    for i in range(n):
        near = kept[:count]
        near = near[((position[near] - position[i]) ** 2).sum(axis=1) <= NEAR_POSITION**2]
        near = near[flat[near] @ flat[i] >= least_trace]
        near = near[((joints[near] - joints[i]) ** 2).mean(axis=1) <= NEAR_JOINTS**2]
        if len(near) == 0:
            distinct[i] = True
            kept[count] = i
            count += 1
    return distinct
