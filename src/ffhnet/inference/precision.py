"""In what precision the engine multiplies."""

from __future__ import annotations

from typing import Literal, get_args

import torch

from ffhnet.errors import OptionError

Precision = Literal["exact", "reduced"]
"""Single precision everywhere; or 16 bits in the products of large generators, where these are faster."""

_LEAST_WIDTH = 256
"""Of a generator whose products are worth it: in narrower ones rounding moves the best grasp, and nothing
is faster."""


def product_dtype(precision: Precision, width: int, device: torch.device) -> torch.dtype:
    """The type in which a generator of some width multiplies on a device.

    Reduced precision is bfloat16 on processors with instructions for it (AVX-512 BF16, AMX), float16 on CUDA
    devices, and the same as exact on all others, which would emulate it.

    Raises:
        OptionError: there is no such precision.
    """
    if precision not in get_args(Precision):
        raise OptionError(f"the precision must be one of {', '.join(get_args(Precision))}, got {precision!r}")
    if precision == "exact" or width < _LEAST_WIDTH:
        return torch.float32
    if device.type == "cuda":
        return torch.float16
    return torch.bfloat16 if _multiplies_bfloat16() else torch.float32


def _multiplies_bfloat16() -> bool:
    """Whether this processor has instructions for products of bfloat16."""
    if not hasattr(torch.cpu, "get_capabilities"):
        return False  # an older torch, which does not tell
    capabilities = torch.cpu.get_capabilities()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))
