"""Real-time five-finger grasps for unknown objects from one depth view."""

__version__ = "0.1.0"
