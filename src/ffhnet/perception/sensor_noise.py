"""`StereoNoise`: what a stereo depth camera makes of a perfect depth image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float

from ffhnet.perception.camera import Intrinsics


@dataclass(frozen=True)
class StereoNoise:
    """Errors of a stereo pair, modelled where they arise: in the disparity d = fx · baseline / depth.

    With the defaults and a focal length of 615 pixels the depth of a smooth surface has a standard
    deviation of about 1 mm at 0.7 m, and it grows with the depth squared.

    Attributes:
        baseline: metres between the two imagers; the second one stands to the right of the first,
            so that shadows lie left of near objects.
        white_sd: pixels of disparity, independent in each pixel.
        correlated_sd: pixels of disparity, smooth over `correlation` pixels, as matching windows make it.
        correlation: standard deviation in pixels of the kernel that smooths that noise.
        subpixel_steps: steps of disparity per pixel.
        edge_jump: a difference of disparity (pixels) between neighbours that counts as a depth edge.
        edge_reach: pixels from which a pixel at an edge may take its value; makes outlines ragged.
        edge_dropout: probability that a pixel at an edge has no reading.
        flying: probability that a pixel at an edge has a depth between the two sides.
        grazing_cosine: surfaces whose normal and line of sight have a smaller cosine give no reading,
            with a blurred limit of `grazing_spread`.
        grazing_spread: standard deviation of that limit.
    """

    baseline: float = 0.05
    white_sd: float = 0.03
    correlated_sd: float = 0.055
    correlation: float = 5.0
    subpixel_steps: int = 32
    edge_jump: float = 1.0
    edge_reach: int = 2
    edge_dropout: float = 0.3
    flying: float = 0.05
    grazing_cosine: float = 0.12
    grazing_spread: float = 0.03

    def apply(
        self, depth: Float[np.ndarray, "H W"], intrinsics: Intrinsics, rng: np.random.Generator
    ) -> Float[np.ndarray, "H W"]:
        """A noisy copy of a depth image.

        Args:
            depth: metres; 0 = no reading.
            intrinsics: the camera.
            rng: source of randomness.

        Returns:
            Metres; 0 = no reading. A pixel without a reading gets one only beside a depth edge.
        """
        focal = intrinsics.fx * self.baseline
        disparity = np.zeros(depth.shape, dtype=np.float32)
        np.divide(focal, depth, out=disparity, where=depth > 0, casting="unsafe")
        edge = _edges(disparity, self.edge_jump)
        lost = _shadow(disparity)
        limit = self.grazing_cosine + self.grazing_spread * _smooth_field(depth.shape, self.correlation, rng)
        lost |= (_cosine(disparity, intrinsics) < limit) & ~edge
        disparity = self._disturb_edges(disparity, edge, rng)
        lost |= disparity <= 0
        disparity += self.white_sd * rng.standard_normal(depth.shape, dtype=np.float32)
        disparity += self.correlated_sd * _smooth_field(depth.shape, self.correlation, rng)
        measured = np.rint(disparity * self.subpixel_steps) / self.subpixel_steps
        measured[lost | (measured <= 0)] = np.inf
        return focal / measured.astype(float)

    def _disturb_edges(
        self, disparity: Float[np.ndarray, "H W"], edge: Bool[np.ndarray, "H W"], rng: np.random.Generator
    ) -> Float[np.ndarray, "H W"]:
        """Ragged outlines, flying pixels and dropout in the pixels at depth edges."""
        rows, columns = np.nonzero(edge)
        n = len(rows)
        step = rng.integers(-self.edge_reach, self.edge_reach + 1, size=(2, n))
        height, width = disparity.shape
        other = disparity[np.clip(rows + step[0], 0, height - 1), np.clip(columns + step[1], 0, width - 1)]
        here = disparity[rows, columns]
        mix = rng.uniform(size=n)
        between = mix * here + (1 - mix) * other
        kind = rng.uniform(size=n)
        flies = (kind < self.flying) & (here > 0) & (other > 0)
        changed = disparity.copy()
        changed[rows, columns] = np.where(flies, between, other)
        gone = kind > 1 - self.edge_dropout
        changed[rows[gone], columns[gone]] = 0
        return changed


def _edges(disparity: Float[np.ndarray, "H W"], jump: float) -> Bool[np.ndarray, "H W"]:
    """Pixels on both sides of a jump of disparity, along rows or columns."""
    edge = np.zeros(disparity.shape, dtype=bool)
    along_row = np.abs(np.diff(disparity, axis=1)) > jump
    along_column = np.abs(np.diff(disparity, axis=0)) > jump
    edge[:, :-1] |= along_row
    edge[:, 1:] |= along_row
    edge[:-1] |= along_column
    edge[1:] |= along_column
    return edge


def _shadow(disparity: Float[np.ndarray, "H W"]) -> Bool[np.ndarray, "H W"]:
    """Pixels of the left image whose point the right imager cannot see.

    A point at column u appears at u - d on the right. It is hidden if a point further right in the left
    image, necessarily nearer, appears at the same place or left of it.
    """
    right = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    leftmost = np.minimum.accumulate(right[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(disparity.shape, dtype=bool)
    hidden[:, :-1] = right[:, :-1] > leftmost[:, 1:]
    return hidden


def _cosine(disparity: Float[np.ndarray, "H W"], intrinsics: Intrinsics) -> Float[np.ndarray, "H W"]:
    """Cosine between the surface normal and the line of sight, 0 where there is no reading.

    On a plane the disparity is linear in the image: d ~ a x + b y + c with (x, y, 1) the direction of
    the pixel, and (a, b, c) is the plane's normal up to scale.
    """
    x, y = (axis.astype(np.float32) for axis in intrinsics.rays())
    a = np.zeros_like(disparity)
    b = np.zeros_like(disparity)
    a[:, 1:-1] = (disparity[:, 2:] - disparity[:, :-2]) * np.float32(intrinsics.fx / 2)
    b[1:-1] = (disparity[2:] - disparity[:-2]) * np.float32(intrinsics.fy / 2)
    c = disparity - a * x - b * y[:, None]
    length = np.sqrt((a * a + b * b + c * c) * (x * x + (y * y + 1)[:, None]))
    return np.divide(disparity, length, out=np.zeros_like(disparity), where=length > 0)


def _smooth_field(
    shape: tuple[int, int], correlation: float, rng: np.random.Generator
) -> Float[np.ndarray, "H W"]:
    """Gaussian noise of mean 0 and standard deviation 1, smoothed by a Gaussian of `correlation` pixels."""
    down, across = (_smoother(size, correlation) for size in shape)
    return down @ rng.standard_normal((down.shape[1], across.shape[1]), dtype=np.float32) @ across.T


@lru_cache(maxsize=16)
def _smoother(size: int, correlation: float) -> Float[np.ndarray, "size coarse"]:
    """Matrix from white noise on a coarse grid to smooth noise of unit variance on `size` pixels."""
    spacing = max(correlation, 1.0)
    margin = 4 * correlation
    grid = np.arange(-margin, size + margin, spacing)
    weights = np.exp(-0.5 * ((np.arange(size)[:, None] - grid) / correlation) ** 2)
    return (weights / np.linalg.norm(weights, axis=1, keepdims=True)).astype(np.float32)
