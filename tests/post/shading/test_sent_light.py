"""What pixels send to others: their light, without what is gathered elsewhere, and the sky that they see."""

from __future__ import annotations

import boxes
import torch

from post.shading.sent_light import outgoing_light, sent_light

SIZE = (24, 32)


def test_light_adds_up():
    frame = boxes.frame()
    assert outgoing_light(frame.replace(ambient=None)) is frame.radiance
    half = torch.full_like(frame.gbuffer.depth, 0.5)
    gi = torch.ones_like(frame.read("radiance"))
    full = outgoing_light(frame.replace(ao=half, gi=gi))
    assert torch.allclose(full, frame.read("radiance") + 0.5 * frame.read("ambient") + 1)
    assert torch.equal(outgoing_light(frame.replace(ao=0 * half, sky_visibility=half, gi=gi)), full)


def test_emission_is_gathered_once() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    emission = torch.full((1, 3, *SIZE), 0.25)
    lamps = frame.replace(gbuffer=frame.gbuffer.replace(emission=emission), ambient=None)
    hit = frame.gbuffer.hit.expand_as(emission)
    radiance = frame.read("radiance")
    assert torch.equal(sent_light(lamps)[hit], (radiance - 0.25).clamp_min(0)[hit])
    assert torch.equal(sent_light(lamps.replace(emitters_sampled=False))[hit], radiance[hit])


def test_senders_of_sky_light_see_only_part_of_the_sky() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    dark = frame.replace(radiance=torch.zeros_like(frame.read("radiance")))
    sent = sent_light(dark)
    assert float((sent - frame.read("ambient")).max()) < 1e-6
    assert float(sent.sum()) < 0.97 * float(frame.read("ambient").sum())
    half = dark.replace(ao=torch.full((1, 1, *SIZE), 0.5))
    torch.testing.assert_close(sent_light(half, distance=5.0), frame.read("ambient") * 0.5)


def test_senders_take_the_visibility_of_the_sky_from_the_frame_before() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    dark = frame.replace(radiance=torch.zeros_like(frame.read("radiance")))
    before = dark.replace(sky_visibility=torch.full((1, 1, *SIZE), 0.25))
    hit = frame.gbuffer.hit.expand(1, 3, *SIZE)
    known = sent_light(dark.replace(previous=before.as_previous()))
    torch.testing.assert_close(known[hit], 0.25 * frame.read("ambient")[hit])
    elsewhere = before.replace(gbuffer=boxes.frame(boxes.camera(SIZE, dx=50.0)).gbuffer)  # shows none of this
    torch.testing.assert_close(sent_light(dark.replace(previous=elsewhere.as_previous())), sent_light(dark))


def test_the_sky_that_senders_see_has_its_gradient() -> None:
    """The coarse sweep also covers it by fractions: dithered bits would pass no gradient on."""
    frame = boxes.frame(boxes.camera(SIZE))
    thickness = frame.read("thickness").clone().requires_grad_()
    (gradient,) = torch.autograd.grad(sent_light(frame, thickness=thickness).sum(), thickness)
    assert float(gradient.abs().max()) > 1e-3
