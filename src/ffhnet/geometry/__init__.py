"""Rotations and rigid transforms: plain functions on arrays."""
