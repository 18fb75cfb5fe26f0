"""The compiled sum of light and the compiled specular albedo against their torch references."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch

from post.shading.composite_op import specular_albedo, specular_cpu, sum_cpu, sum_light

PARTS = ("ambient", "emission", "visibility", "gi", "reflection", "behind", "specular")


def light() -> dict[str, Any]:
    generator = torch.Generator().manual_seed(4)
    sizes = {name: 1 if name in ("visibility", "specular") else 3 for name in ("radiance", *PARTS)}
    return {name: torch.rand(2, size, 27, 19, generator=generator) * 1.3 for name, size in sizes.items()}


@pytest.mark.parametrize("physical", [True, False])
@pytest.mark.parametrize("absent", [(), *((name,) for name in PARTS), PARTS])
def test_forms_agree(physical: bool, absent: tuple[str, ...]) -> None:
    given: dict[str, Any] = {name: None if name in absent else tensor for name, tensor in light().items()}
    options = {"physical": physical, "intensities": (1.0, 0.7, 1.4)}
    got, want = (sum_light(**given, **options, compiled=form) for form in (None, False))
    torch.testing.assert_close(got, want, rtol=2e-6, atol=1e-6)


def test_the_reference_serves_exponents_broadcasts_and_gradients() -> None:
    given = light()
    full = sum_light(**given, physical=True, intensities=(2.0, 1.0, 1.0))
    once = sum_light(
        **{**given, "visibility": given["visibility"].clamp(0, 1) ** 2}, physical=True, intensities=(1, 1, 1)
    )
    torch.testing.assert_close(full, once, rtol=2e-6, atol=1e-6)
    grey = {**given, "gi": given["gi"][:, :1]}
    wide = {**given, "gi": given["gi"][:, :1].expand(-1, 3, -1, -1)}
    one, other = (sum_light(**g, physical=True, intensities=(1, 1, 1)) for g in (grey, wide))
    torch.testing.assert_close(one, other, rtol=2e-6, atol=1e-6)
    gi = given["gi"].requires_grad_()
    sum_light(**given, physical=True, intensities=(1, 1, 1)).sum().backward()
    assert gi.grad is not None
    assert float(gi.grad.abs().max()) > 0


@pytest.mark.parametrize("case", ["perspective", "orthographic", "jittered", "smooth"])
def test_forms_of_the_specular_albedo_agree(case: str) -> None:
    camera = boxes.cameras(2, (37, 53), orthographic=case == "orthographic")
    camera = camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera
    g = boxes.frame(camera).gbuffer
    rough = torch.rand(g.depth.shape, generator=torch.Generator().manual_seed(2)) * 1.2 - 0.1
    g = g.replace(roughness=None if case == "smooth" else rough)
    got, want = (specular_albedo(g, compiled=form) for form in (True, False))
    assert float(want.max() - want[g.hit].min()) > 0.01
    torch.testing.assert_close(got, want, rtol=1e-4, atol=2e-6)


def test_operators_are_registered_properly() -> None:
    parts, utils = list(light().values()), ("test_schema", "test_faketensor")
    torch.library.opcheck(sum_cpu, (parts, True, 1.0, 1.0), test_utils=utils)
    given = (parts[0], parts[3] > 0.5, parts[3], torch.ones(2, 6), torch.eye(3).expand(2, 3, 3), torch.rand(17, 65))
    torch.library.opcheck(specular_cpu, (*given, False), test_utils=utils)
