"""States of histories as one tensor: planes that lie side by side in memory are not copied to be read together."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor


def together(parts: Sequence[Tensor]) -> Tensor:
    """Parts ``(B, C_i, H, W)`` as one ``(B, sum of C_i, H, W)``: a view where they are pieces of one tensor in this
    order, as `torch.split` gives them, else a copy. Callers must not write to it. Parts with gradients are copied.
    """
    first, place = parts[0], parts[0].storage_offset()
    pieces = not any(part.requires_grad for part in parts)
    for part in parts:
        pieces = pieces and _same_tensor(first, part) and part.storage_offset() == place
        place += part.shape[1] * first.stride(1)
    if not pieces:
        return torch.cat(list(parts), dim=1)
    size = (first.shape[0], sum(part.shape[1] for part in parts), *first.shape[2:])
    return first.as_strided(size, first.stride())


def _same_tensor(one: Tensor, other: Tensor) -> bool:
    if one.device != other.device or one.dtype != other.dtype or one.stride() != other.stride():
        return False
    return one.untyped_storage().data_ptr() == other.untyped_storage().data_ptr()
