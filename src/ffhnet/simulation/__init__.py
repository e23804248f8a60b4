"""MuJoCo scenes and the grasp trial that earns every label."""
