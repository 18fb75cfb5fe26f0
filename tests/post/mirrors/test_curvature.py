"""Images in curved mirrors: where a ball showed the same point of the floor in the frame before."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.directions import length
from gbufrt.sampling import sample
from post.mirrors.image import Image, mirror_image

SIZE = (96, 128)  # too few pixels for what the ball shows, if `wide` were not told
CENTER, RADIUS = torch.tensor([0.0, 1.2, 0.0]), 1.2  # over a floor at y = 0


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """Balls of few pixels show images all the same, so that the geometry of these can be told."""
    monkeypatch.setattr("post.mirrors.curvature.TIGHT", math.inf)


def camera(x: float, *, orthographic: bool = False) -> Camera:
    height = 5.0 if orthographic else None
    return Camera.look_at(
        (x, 3.0, 6.0), (0.3 * x, 0.8, 0.0), size=SIZE, fov_y=40.0, far=100.0, orthographic_height=height
    )


def spun(angle: float) -> Tensor:
    """``(3, 3)`` a turn about z."""
    c, s = math.cos(angle), math.sin(angle)
    return torch.tensor([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def ball(view: Camera, before: Camera, spin: float = 0.0) -> tuple[GBuffer, Tensor]:
    """A mirror ball on a floor, by their equations; and ``(B, 3, H, W)`` the point of the floor that it shows, or NaN.

    ``spin`` is the angle by which the ball has turned since the frame before.
    """
    origin, way = (t.permute(0, 3, 1, 2) for t in view.rays())
    center = CENTER[None, :, None, None]
    half = ((center - origin) * way).sum(1, keepdim=True)
    root = half.square() - (center - origin).square().sum(1, keepdim=True) + RADIUS**2
    mirror = root > 0
    floor = -origin[:, 1:2] / way[:, 1:2]
    hit = mirror | (floor > 0)
    t = torch.where(mirror, half - root.clamp_min(0.0).sqrt(), floor)
    points = origin + way * t
    up = torch.tensor([0.0, 1.0, 0.0])[None, :, None, None]
    normal = torch.where(mirror, (points - center) / RADIUS, up)
    turned = torch.einsum("ij,bjhw->bihw", spun(-spin), points - center) + center
    was = before.to_view(torch.where(mirror, turned, points))
    z = torch.where(hit, view.to_view(points)[:, 2:], view.far)
    one = torch.ones_like(z)
    g = GBuffer(
        camera=view,
        previous_camera=before,
        depth=z,
        hit=hit,
        normal=torch.where(hit, normal, 0.0),
        motion=torch.where(hit, before.project(was) - view.pixel_centers(), 0.0),
        motion_z=torch.where(hit, was[:, 2:] - z, 0.0),
        albedo=0.9 * torch.ones_like(normal),
        roughness=torch.where(mirror, 0.0, one),
        metallic=torch.where(mirror, 1.0, 0.0 * one),
    )
    away = way - 2 * (way * normal).sum(1, keepdim=True) * normal
    shows = points - away * points[:, 1:2] / away[:, 1:2]
    return g, torch.where(mirror & (away[:, 1:2] < 0), shows, torch.nan)


def images(shift: float, *, spin: float = 0.0, orthographic: bool = False) -> tuple[Image, Tensor, Tensor]:
    """Of this frame, knowing the mirrors of the one before; and what the ball shows in both."""
    now, before = camera(shift, orthographic=orthographic), camera(0.0, orthographic=orthographic)
    past, shown_before = ball(before, before)
    earlier = mirror_image(past)
    g, shown = ball(now, before, spin)
    image = mirror_image(g, before=None if earlier is None else earlier.facing)
    assert image is not None
    return image, shown, shown_before


def misses(image: Image, shown: Tensor, before: Tensor) -> Tensor:
    """How far from where its motion leads each pixel's point was shown, in pixels of the frame before."""
    motion = image.gbuffer.motion
    assert motion is not None
    there = sample(before, image.gbuffer.camera.pixel_centers() + motion)
    apart = torch.minimum(*(length(before.diff(dim=dim))[..., : SIZE[0] - 1, : SIZE[1] - 1] for dim in (2, 3)))
    pixels = length(there - shown)[..., :-1, :-1] / apart
    on_screen = (length(image.gbuffer.normal - image.facing) > 1e-3)[..., :-1, :-1]
    return pixels[on_screen & image.mask[..., :-1, :-1] & pixels.isfinite()]


@pytest.mark.usefixtures("wide")
@pytest.mark.parametrize("orthographic", [False, True])
def test_images_in_a_ball_move_with_the_point_that_they_show(orthographic, monkeypatch):
    seen = images(0.4, orthographic=orthographic)
    curved = misses(*seen)
    assert len(curved) > 100
    monkeypatch.setattr("post.mirrors.curvature.CREASE", 2.0)  # no neighbours: every pixel is its tangent plane
    flat = misses(*images(0.4, orthographic=orthographic))
    assert 10 * float(curved.median()) < 0.5 < float(flat.median())


def test_tight_images_move_as_others_do_and_leave_the_geometry_alone(monkeypatch):
    """What a pixel of so small a ball shows has no neighbours, but moves over it as other images do."""
    tight, *_ = images(0.4)
    own, _ = ball(camera(0.4), camera(0.0))
    assert not bool(tight.mask.any())
    assert torch.equal(tight.gbuffer.depth, own.depth)
    assert torch.equal(tight.gbuffer.normal, own.normal)
    monkeypatch.setattr("post.mirrors.curvature.TIGHT", math.inf)
    wide, *_ = images(0.4)
    assert torch.equal(tight.follows, wide.mask)
    assert torch.equal(torch.as_tensor(tight.gbuffer.motion), torch.as_tensor(wide.gbuffer.motion))
    assert float(length(torch.as_tensor(tight.gbuffer.motion) - torch.as_tensor(own.motion))[tight.follows].max()) > 0.5


@pytest.mark.usefixtures("wide")
def test_a_ball_that_spins_shows_the_same():
    image, shown, _ = images(0.0, spin=0.15)
    known = image.mask & shown.isfinite().all(1, keepdim=True)
    own, _ = ball(camera(0.0), camera(0.0), spin=0.15)
    assert own.motion is not None
    assert image.gbuffer.motion is not None
    assert float(length(image.gbuffer.motion)[known].median()) < 0.05
    blind = mirror_image(own)
    assert blind is not None
    assert blind.gbuffer.motion is not None
    assert float(length(blind.gbuffer.motion)[known].median()) > 0.5


def test_normals_of_other_frames_do_not_fit():
    g, _ = ball(camera(0.4), camera(0.0))
    image, other = mirror_image(g), mirror_image(g, before=torch.ones(1, 3, 8, 8))
    assert image is not None
    assert other is not None
    assert torch.equal(torch.as_tensor(image.gbuffer.motion), torch.as_tensor(other.gbuffer.motion))
