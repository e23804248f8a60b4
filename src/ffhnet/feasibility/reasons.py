"""Why a grasp cannot be done."""

from __future__ import annotations

from enum import IntEnum


class Reason(IntEnum):
    """Why a grasp cannot be done; the first of these that holds."""

    FEASIBLE = 0
    TABLE = 1  # the open hand at the grasp is below the table or too near
    OBJECT = 2  # it penetrates the observed object
    SCENE = 3  # it penetrates something else that was seen, or the closed fingers do
    APPROACH = 4  # the straight way there is not free
    UNREACHABLE = 5  # the arm does not reach the grasp, the way there, or the way up
    ARM_COLLISION = 6  # the arm hits table, scene or itself there
    NOT_TRIED = 7  # enough better grasps were found before the arm's way to this one was planned

    @property
    def word(self) -> str:
        """The word that stands for it in files and messages."""
        return self.name.lower().replace("_", " ")
