"""The public object `FFHNet`."""

from ffhnet.inference.ffhnet import FFHNet

__all__ = ["FFHNet"]
