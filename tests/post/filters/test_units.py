"""Mean directions made unit vectors: the kernel against its torch reference."""

from __future__ import annotations

import pytest
import torch

from post.filters.constants import SHORTEST
from post.filters.units import unit_cpu, unit_vectors


def vectors(size: tuple[int, int]) -> tuple[torch.Tensor, torch.Tensor]:
    """Vectors of any length, a third of which have cancelled, and others in their place."""
    drawn = torch.Generator().manual_seed(1)
    vector, fallback = torch.randn(2, 2, 3, *size, generator=drawn)
    scale = torch.tensor([1.0, 0.5 * SHORTEST, 0.0])[torch.randint(3, (2, 1, *size), generator=drawn)]
    return vector / vector.norm(dim=1, keepdim=True) * scale, fallback


@pytest.mark.parametrize("size", [(27, 73), (1, 1)])
def test_forms_agree(size: tuple[int, int]) -> None:
    got, want = (unit_vectors(*vectors(size), compiled=form) for form in (True, False))
    torch.testing.assert_close(got, want, rtol=3e-7, atol=0.0)


def test_what_cancelled_takes_the_fallback() -> None:
    vector, fallback = vectors((9, 9))
    got, short = unit_vectors(vector, fallback), (vector.norm(dim=1, keepdim=True) < SHORTEST).expand(-1, 3, -1, -1)
    assert torch.equal(got[short], fallback[short])
    torch.testing.assert_close(got.norm(dim=1)[~short[:, 0]], torch.ones(int((~short[:, 0]).sum())))


def test_any_layout_and_gradients() -> None:
    vector, fallback = vectors((6, 8))
    strided = vector.contiguous(memory_format=torch.channels_last)
    assert torch.equal(unit_vectors(strided, fallback), unit_vectors(vector, fallback))
    strided.requires_grad_()
    unit_vectors(strided, fallback)[:, 0].sum().backward()
    assert strided.grad is not None
    assert float(strided.grad.abs().max()) > 0


def test_operator_is_registered_properly() -> None:
    torch.library.opcheck(unit_cpu, vectors((6, 8)), test_utils=("test_schema", "test_faketensor"))
