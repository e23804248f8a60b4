"""Hands: a TOML and an MJCF each, with forward kinematics that needs neither MuJoCo nor a GPU."""

from ffhnet.hands.hand import DEFAULT_HAND, ClosingMotion, Hand, load_hand

__all__ = ["DEFAULT_HAND", "ClosingMotion", "Hand", "load_hand"]
