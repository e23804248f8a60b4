"""The Franka Emika Panda arm: kinematics, reachability, and trials with the hand on the arm."""
