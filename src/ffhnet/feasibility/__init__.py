"""Which grasps can be done: the hand and the arm against the table and all that the camera saw."""
