"""What the networks see of an object: the BPS (raw or projected) and the height of the table."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ffhnet.model.config import ModelConfig
from ffhnet.model.pca import Projection
from ffhnet.model.tensors import ObjectTensors


class ObjectCondition(nn.Module):
    """Turns an observation into the vector that conditions both networks.

    With `pca_components` the BPS goes through a fixed affine projection, whose mean and matrix are
    buffers and so travel with the weights. Until `set_projection` is called they are zero.
    """

    bps_mean: Tensor
    projection: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.config = config
        if config.pca_components is not None:
            self.register_buffer("bps_mean", torch.zeros(config.bps_size))
            self.register_buffer("projection", torch.zeros(config.bps_size, config.pca_components))

    def set_projection(self, projection: Projection) -> None:
        """Store a projection fitted with `fit_projection`."""
        self.bps_mean.copy_(torch.as_tensor(projection.mean))
        self.projection.copy_(torch.as_tensor(projection.matrix))

    def forward(self, objects: ObjectTensors) -> Float[Tensor, "V C"]:
        """Condition of each of V views."""
        condition = objects.bps
        if self.config.pca_components is not None:
            condition = (condition - self.bps_mean) @ self.projection
        if self.config.use_table_height:
            height = objects.table_height[:, None] / self.config.height_scale
            condition = torch.cat([condition, height], dim=-1)
        return condition
