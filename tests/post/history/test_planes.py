"""Planes that are read together."""

from __future__ import annotations

import torch

from post.history.planes import together


def test_pieces_of_one_tensor_in_order_are_not_copied() -> None:
    whole = torch.rand(2, 6, 3, 4)
    pieces = whole.split([3, 1, 2], dim=1)
    assert torch.equal(together(pieces), whole)
    assert together(pieces).data_ptr() == whole.data_ptr()
    inner = together(pieces[1:])
    assert torch.equal(inner, whole[:, 3:])
    assert inner.data_ptr() == pieces[1].data_ptr()


def test_others_are_joined_as_they_are() -> None:
    whole = torch.rand(2, 6, 3, 4)
    a, b, c = whole.split([3, 1, 2], dim=1)
    for parts in ((a, c), (b, a, c), (a, b.clone(), c), (a, b, c + 0), (a, a), (whole.transpose(2, 3)[:, :1], b.mT)):
        assert torch.equal(together(parts), torch.cat(parts, dim=1))
    kept = whole.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(together(kept.split([2, 4], dim=1)).sum(), kept)
    assert torch.equal(gradient, torch.ones_like(kept))
