"""The CUDA forms of `post`, in numba's simulator of a GPU, and compiled for one."""

from __future__ import annotations

from pathlib import Path

import forms
import pytest
import torch
from simulated import answers_of

SCRIPT = Path(forms.__file__)


def check(found: dict[str, torch.Tensor]) -> None:
    wanted = forms.answers()
    assert found.keys() == wanted.keys()
    for name, want in wanted.items():
        apart = (found[name] - want).abs().amax(1)
        assert (apart <= 1e-4).float().mean() > 0.98, f"{name}: a sector may flip where rounding meets the dither"
        assert want.std() > 0.01, name


def test_the_simulated_cuda_forms_answer_as_those_of_the_cpu(tmp_path: Path) -> None:
    found, ran = answers_of(SCRIPT, tmp_path / "answers.pt")
    light = {"sweep", "padded", "bodies", "agx", "encode", "vignette", "upsampled", "read", "tone", "alias", "luma"}
    light |= {
        "samples",
        "backs",
        "upscaled",
        "surface",
        "moments",
        "limits",
        "bilateral",
        "wavelet",
        "sample",
        "differences",
        "unexplained",
        "blend",
        "stairs",
        "layer",
        "sum",
        "specular",
        "unit",
        "kindred",
    }
    assert ran == {
        "march",
        "planes_cell",
        "coarser_cell",
        "reflect",
        "calmed",
        "image_motion",
        "closer",
        "through_air",
        "reconstruct_pixel",
        "prefilter_pixel",
        "similar_pixel",
        "turn_pixel",
        *(f"{name}_pixel" for name in light),
    }
    check(found)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_the_cuda_forms_answer_as_those_of_the_cpu() -> None:
    pytest.importorskip("numba_cuda")
    check(forms.answers("cuda"))
