"""Light adds up: nothing counted twice, nothing lost."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Pipeline
from post.passes.light.composite import Composite, composite
from post.shading.composite_op import specular_albedo


def planes(*values: float, channels: int = 3) -> list[torch.Tensor]:
    return [torch.full((2, channels, 4, 5), v) for v in values]


def test_physical_sum():
    radiance, ambient, gi, reflection = planes(1.0, 0.5, 0.25, 0.125)
    (visibility,) = planes(0.5, channels=1)
    got = composite(radiance, ambient=ambient, visibility=visibility, gi=gi, reflection=reflection)
    assert got.unique().tolist() == [1.0 + 0.25 + 0.25 + 0.125]


def test_me1_darkens_direct_light_but_not_lamps():
    radiance, ambient, emission = planes(3.0, 0.5, 2.0)
    (visibility,) = planes(0.5, channels=1)
    got = composite(radiance, ambient=ambient, emission=emission, visibility=visibility, mode="me1")
    assert got.unique().tolist() == [0.5 * (3.0 + 0.5 - 2.0) + 2.0]


@pytest.mark.parametrize("mode", ["physical", "me1"])
def test_absent_parts_are_neutral(mode):
    (radiance,) = planes(0.7)
    assert torch.equal(composite(radiance, mode=mode), radiance)
    (open_sky,) = planes(1.0, channels=1)
    assert torch.equal(composite(radiance, visibility=open_sky, mode=mode), radiance)


@pytest.mark.parametrize("mode", ["physical", "me1"])
def test_a_closed_furnace_keeps_its_radiance(mode):
    """Albedo 1 and radiance L from everywhere: half the sky blocked by senders of L still gives L."""
    ambient, gi = planes(1.0, 0.5)
    (visibility,) = planes(0.5, channels=1)
    got = composite(torch.zeros_like(ambient), ambient=ambient, visibility=visibility, gi=gi, mode=mode)
    assert got.unique().tolist() == [1.0]


def test_intensities():
    radiance, ambient, gi, reflection = planes(1.0, 1.0, 1.0, 1.0)
    (visibility,) = planes(0.25, channels=1)
    got = composite(
        radiance,
        ambient=ambient,
        visibility=visibility,
        gi=gi,
        reflection=reflection,
        ao_intensity=0.5,
        gi_intensity=2.0,
        reflection_intensity=0.0,
    )
    assert got.unique().tolist() == [1.0 + 0.5 + 2.0]


@pytest.mark.parametrize("mode", ["physical", "me1"])
def test_gradients(mode):
    tensors = [torch.rand(1, c, 2, 3, dtype=torch.float64) * 0.8 + 0.1 for c in (3, 3, 3, 1, 3, 3)]
    names = ("ambient", "emission", "visibility", "gi", "reflection")

    def f(radiance, *rest):
        return composite(radiance, mode=mode, ao_intensity=1.5, **dict(zip(names, rest, strict=True)))

    inputs = [t.requires_grad_() for t in tensors]
    assert torch.autograd.gradcheck(f, inputs)
    grads = torch.autograd.grad(f(*inputs).sum(), inputs, allow_unused=True)
    used = [g is not None and bool(g.abs().min() > 0) for g in grads]
    assert used[0]
    assert used[1]
    assert all(used[3:])


def test_light_from_behind_arrives_through_the_surface():
    front = boxes.frame()
    half = torch.where(front.gbuffer.object_id == 1, 0.5, 0.0).expand(-1, 3, -1, -1)
    behind = boxes.frame(boxes=boxes.ROOM[:2])
    front = front.replace(gbuffer=front.gbuffer.replace(transmittance=half), behind=behind)
    got = Composite()(front)
    alone, back = Composite()(front.replace(behind=None)), Composite()(behind)
    torch.testing.assert_close(got.read("composite"), alone.read("composite") + half * back.read("composite"))
    assert (got.read("composite") - alone.read("composite")).abs().max() > 0.1


def test_module_reads_the_visibility_that_fits_its_mode():
    frame = boxes.frame().replace(ao=torch.zeros(1, 1, 72, 96), sky_visibility=torch.ones(1, 1, 72, 96))
    open_frame = boxes.frame()
    assert torch.equal(Composite()(frame).read("color"), Composite()(open_frame).read("color"))
    assert Composite(mode="me1")(frame).read("color").max() == 0
    fallback = Composite()(frame.replace(sky_visibility=None)).read("color")
    torch.testing.assert_close(fallback, frame.read("radiance"))
    assert Pipeline(composite=Composite()).writes == {"composite", "color"}


def test_unknown_mode():
    with pytest.raises(ValueError, match="mode must be"):
        composite(torch.ones(1, 3, 2, 2), mode="both")  # pyright: ignore[reportArgumentType]


def test_what_a_surface_mirrors_does_not_get_under_it():
    """White walls that reflect a part of a uniform light, and transmit a part, still send just that light."""
    mirrored, visibility = torch.rand(2, 2, 1, 4, 5, generator=torch.Generator().manual_seed(0)).unbind(0)
    (light,) = planes(1.0)
    diffuse, behind = 0.7 * light, 0.3 * light
    got = composite(
        torch.zeros_like(light), ambient=diffuse, visibility=visibility, gi=diffuse * (1 - visibility), behind=behind,
        reflection=mirrored * light, specular=mirrored,
    )  # fmt: skip
    torch.testing.assert_close(got, light)


def test_lamps_shine_through_what_they_mirror():
    emission, reflection = planes(2.0, 0.25)
    (mirrored,) = planes(0.5, channels=1)
    got = composite(emission, emission=emission, reflection=reflection, specular=mirrored)
    assert got.unique().tolist() == [2.25]


def test_without_a_reflection_nothing_is_taken_away():
    radiance, reflection = planes(1.0, 0.5)
    (mirrored,) = planes(0.5, channels=1)
    assert torch.equal(composite(radiance, specular=mirrored), radiance)
    off = composite(radiance, reflection=reflection, specular=mirrored, reflection_intensity=0.0)
    assert torch.equal(off, radiance)
    assert torch.equal(composite(radiance, reflection=reflection, specular=mirrored, mode="me1"), radiance + reflection)


def test_module_takes_what_the_surfaces_mirror():
    frame = boxes.frame()
    plain = Composite()(frame).read("color")
    black = Composite()(frame.replace(reflection=torch.zeros_like(plain))).read("color")
    g = frame.gbuffer
    own = plain - (torch.zeros_like(plain) if g.emission is None else g.emission)
    torch.testing.assert_close(plain - black, specular_albedo(g) * own)
    assert (plain - black)[g.hit.expand_as(plain)].max() > 0.01
    assert torch.equal(plain[~g.hit.expand_as(plain)], black[~g.hit.expand_as(plain)])


def test_mirrors_darken_what_is_behind_them_too():
    front = boxes.frame()
    half = torch.where(front.gbuffer.object_id == 1, 0.5, 0.0).expand(-1, 3, -1, -1)
    black, behind = torch.zeros_like(front.read("radiance")), boxes.frame(boxes=boxes.ROOM[:2])
    front = front.replace(gbuffer=front.gbuffer.replace(transmittance=half), reflection=black)
    got = Composite()(front.replace(behind=behind)).read("composite") - Composite()(front).read("composite")
    back = half * Composite()(behind).read("composite")
    torch.testing.assert_close(got, (1 - specular_albedo(front.gbuffer)) * back)
