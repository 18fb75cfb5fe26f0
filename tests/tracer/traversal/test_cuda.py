"""The CUDA form of the traversals, on a GPU or in numba's simulator of one."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
import traversals
from gpu_stand_in import GPU, gpu
from simulated import answers_of
from torch import Tensor

from gbufrt.compute import cuda
from gbufrt.compute.dispatch import Form, form_of
from tracer.traversal import op, reference
from tracer.weather.reference import CLOSE

SCRIPT = Path(traversals.__file__)


def same(found: dict[str, Tensor], wanted: dict[str, Tensor]) -> None:
    assert found.keys() == wanted.keys()
    for name, want in wanted.items():
        atol = CLOSE if name == "waves" else 1e-5  # rays stop as soon as they are so close to a wave
        torch.testing.assert_close(
            found[name], want, rtol=1e-6, atol=atol, msg=lambda text, name=name: f"{name}: {text}"
        )


def covers_what_matters(wanted: dict[str, Tensor]) -> None:
    """World and instance, air and glass, front and back are all among the answers."""
    assert wanted["first instance"].unique().tolist() == [0, 1]
    assert wanted["inside back_face"].any()
    assert ((wanted["transmission"] > 0) & (wanted["transmission"] < 1)).any()
    assert wanted["transmission"].min() == 0
    assert (wanted["runs"][0] > wanted["runs"][1]).any()
    assert not torch.equal(wanted["first t"][0], wanted["first t"][1])
    assert wanted["waves"].std() > 0.1
    assert wanted["caustics"].std() > 0.01


@pytest.fixture
def wanted(monkeypatch: pytest.MonkeyPatch) -> dict[str, Tensor]:
    """The answers of the torch reference."""
    with monkeypatch.context() as patch:
        for name in ("surface", "transmit", "runs"):
            patch.setattr(op, name, getattr(reference, name))
        return traversals.answers()


def test_the_cpu_form_answers_as_the_reference(wanted: dict[str, Tensor]) -> None:
    covers_what_matters(wanted)
    same(traversals.answers(), wanted)


def test_the_simulated_cuda_form_answers_as_the_reference(wanted: dict[str, Tensor], tmp_path: Path) -> None:
    same(answers_of(SCRIPT, tmp_path / "answers.pt")[0], wanted)


def test_waves_take_their_kernels_on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[str] = []
    with gpu(monkeypatch), monkeypatch.context() as patch:
        patch.setattr(cuda, "launch", lambda body, *given: ran.append(body.__name__))
        traversals.waters(GPU)
    assert ran == ["meet", "focused"]


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_the_cuda_form_answers_as_the_reference(wanted: dict[str, Tensor]) -> None:
    pytest.importorskip("numba_cuda")
    assert form_of(torch.zeros(1, device="cuda"), cuda=True) is Form.CUDA
    same(traversals.answers("cuda"), wanted)
