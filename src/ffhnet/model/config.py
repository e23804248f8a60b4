"""Sizes and switches of the two networks, with the paper's preset and the project's own."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from ffhnet.errors import OptionError
from ffhnet.model.flow_steps import FlowSolver

if TYPE_CHECKING:
    from ffhnet.hands.link_points import LinkPoints

MAX_FLOW_STEPS = 1000
"""More would not make samples better, only keep a robot waiting."""

MAX_TEMPERATURE = 2.0
"""Above it, samples are noise."""


@dataclass(frozen=True)
class ModelConfig:
    """Architecture shared by FFHGenerator and FFHEvaluator.

    Attributes:
        num_joints: actuated joints of the hand.
        bps_size: length of the basis point set vector.
        pca_components: width of the fixed projection of the BPS, or None to feed the raw vector.
        use_table_height: give the height of the table (view frame) to the networks.
        input_batch_norm: normalise raw inputs by batch norm (paper) instead of by fixed scales.
        skip_batch_norm: batch norm also on the skip path of a ResBlock (paper yes, public code no).
        use_joints: the evaluator sees the joint angles (paper yes, public code no).
        position_scale: metres that count as 1 at the networks' inputs and outputs.
        joint_scale: radians that count as 1.
        height_scale: metres of table height that count as 1.
        generator: FFHGenerator ("cvae", the paper's) or FlowGenerator ("flow").
        temperature: standard deviation of the noise that samples start from; below 1, samples keep to what
            the generator is sure of: fewer collisions, less variety.
        latent: size of the cVAE's latent vector.
        inner_width: width between the two layers of a ResBlock.
        width: output width of a ResBlock.
        dropout: dropout after each ResBlock of the evaluator.
        palm_points: points around the hand at which evaluator and flow read the distance field, 0 for none.
        links: links of the hand.
        link_points: points on them, which move with the joints, at which the evaluator reads the field and
            the height over the table, for the open hand and for the grasp's joints; 0 for none.
        local_width: width of the layer that sums up for the evaluator what is read around the hand, or 0 to
            feed that to each block as it is.
        judge_robustness: the evaluator also predicts success under varied physics, and start collisions.
        flow_width: width of the flow's blocks.
        flow_blocks: number of them.
        flow_steps: steps from noise to grasp.
        flow_solver: how they are taken.
        flow_palm_points: how many of the palm points the flow reads, the first ones; all if there are fewer.
    """

    num_joints: int = 15
    bps_size: int = 4096
    pca_components: int | None = 96
    use_table_height: bool = True
    input_batch_norm: bool = False
    skip_batch_norm: bool = True
    use_joints: bool = True
    position_scale: float = 0.1
    joint_scale: float = 0.5
    height_scale: float = 0.1
    generator: Literal["cvae", "flow"] = "flow"
    temperature: float = 0.75
    latent: int = 5
    inner_width: int = 256
    width: int = 512
    dropout: float = 0.3
    palm_points: int = 96
    links: int = 0
    link_points: int = 0
    local_width: int = 0
    judge_robustness: bool = True
    flow_width: int = 384
    flow_blocks: int = 4
    flow_steps: int = 8
    flow_solver: FlowSolver = "euler"
    flow_palm_points: int = 96

    def __post_init__(self) -> None:
        widths = (self.inner_width, self.width, self.flow_width)
        sizes = (self.num_joints, self.bps_size, self.latent, *widths, self.flow_blocks, self.flow_steps)
        if min(sizes) < 1:
            raise OptionError(f"all sizes of ModelConfig must be at least 1, got {sizes}")
        if self.flow_steps > MAX_FLOW_STEPS:
            raise OptionError(f"flow_steps must be at most {MAX_FLOW_STEPS}, got {self.flow_steps}")
        counts = (self.palm_points, self.flow_palm_points, self.links, self.link_points, self.local_width)
        if min(counts) < 0:
            names = "palm_points, flow_palm_points, links, link_points, local_width"
            raise OptionError(f"{names} must be at least 0, got {counts}")
        if self.link_points and not (self.links > 0 and self.palm_points and self.use_table_height):
            raise OptionError("link_points want links, palm_points and use_table_height")
        check_temperature(self.temperature)
        if self.generator not in ("cvae", "flow"):
            raise OptionError(f"the generator is 'cvae' or 'flow', got {self.generator!r}")
        if self.flow_solver not in get_args(FlowSolver):
            wanted = " or ".join(repr(solver) for solver in get_args(FlowSolver))
            raise OptionError(f"flow_solver is {wanted}, got {self.flow_solver!r}")
        if self.pca_components is not None and not 1 <= self.pca_components <= self.bps_size:
            raise OptionError(
                f"pca_components must lie between 1 and bps_size {self.bps_size}, got {self.pca_components}"
            )

    @classmethod
    def default(cls, num_joints: int = 15) -> ModelConfig:
        """The project's own preset.

        BPS through a fixed PCA projection (neighbouring entries are nearly collinear, which makes the raw
        4096 inputs slow to learn from), table height, distances around the hand, a flow as generator.
        """
        return cls(num_joints=num_joints)

    @classmethod
    def small(cls, num_joints: int = 15) -> ModelConfig:
        """The default at less than half its widths, for another hand: both files take less than 3 MB."""
        return cls(
            num_joints=num_joints,
            pca_components=48,
            inner_width=96,
            width=192,
            palm_points=64,
            flow_width=192,
            flow_blocks=3,
            flow_palm_points=64,
        )

    @classmethod
    def paper(cls, num_joints: int = 15) -> ModelConfig:
        """Section III with the sizes of the public code: raw BPS, input batch norm, no table height."""
        return cls(
            num_joints=num_joints,
            pca_components=None,
            use_table_height=False,
            input_batch_norm=True,
            skip_batch_norm=False,
            position_scale=1.0,
            joint_scale=1.0,
            generator="cvae",
            temperature=1.0,
            palm_points=0,
            judge_robustness=False,
        )

    def with_links(self, hand: LinkPoints) -> ModelConfig:
        """The same with an evaluator that looks at points on a hand's links, too."""
        links, points = len(hand.parent), len(hand.points)
        return dataclasses.replace(self, links=links, link_points=points, local_width=128)

    def student(self) -> ModelConfig:
        """The same with networks of a fortieth of the multiplications, to be distilled from this one's.

        Without dropout, which keeps networks from learning trials by heart: a teacher rates any number.
        """
        return dataclasses.replace(
            self,
            flow_width=128,
            flow_blocks=2,
            flow_steps=2,
            flow_solver="euler",
            flow_palm_points=32,
            inner_width=56,
            width=112,
            palm_points=min(self.palm_points, 48),
            links=0,
            link_points=0,
            local_width=0,
            dropout=0.0,
        )

    @property
    def condition_width(self) -> int:
        """Width of what the networks see of the object."""
        bps = self.bps_size if self.pca_components is None else self.pca_components
        return bps + int(self.use_table_height)

    def grasp_width(self, with_joints: bool) -> int:
        """Width of what the networks see of a grasp: rotation 9, position 3, joints."""
        return 12 + (self.num_joints if with_joints else 0)


def check_temperature(temperature: float) -> None:
    """Raise OptionError for one at which nothing can be sampled."""
    if not 0 < temperature <= MAX_TEMPERATURE:
        raise OptionError(f"wanted a temperature above 0, up to {MAX_TEMPERATURE:g}, got {temperature}")
