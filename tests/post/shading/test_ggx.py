"""The GGX model against its own integrals."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.directions import tangent_frame
from gbufrt.specular import ggx_distribution, masking_ratio, sample_visible_normal, schlick, smith_lambda
from post.shading.composite_op import specular_albedo
from post.shading.ggx import reflection_pdf, specular_f0

VIEWS = [0.15, 0.6, 1.0]
ALPHAS = [0.05, 0.3, 1.0]


def eye(cosine: float) -> Tensor:
    return torch.tensor([math.sqrt(1 - cosine**2), 0.0, cosine], dtype=torch.float64).view(1, 3, 1)


def half_vectors(count: int = 800) -> tuple[Tensor, Tensor]:
    """Half vectors over the upper hemisphere ``(1, 3, n)``, packed where GGX is narrow, and their solid angles."""
    u = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    theta = u**3 * math.pi / 2
    edges = (torch.arange(count + 1, dtype=torch.float64) / count) ** 3 * math.pi / 2
    ring = edges[:-1].cos() - edges[1:].cos()
    phi = (torch.arange(90, dtype=torch.float64) + 0.5) * (2 * math.pi / 90)
    theta, phi = torch.meshgrid(theta, phi, indexing="ij")
    vectors = torch.stack([theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()])
    return vectors.reshape(1, 3, -1), (ring[:, None] * (2 * math.pi / 90)).expand_as(theta).reshape(1, 1, -1)


def samples(count: int = 40000) -> Tensor:
    """The R2 sequence, ``(1, 2, count)``."""
    place = torch.arange(count, dtype=torch.float64) + 0.5
    return torch.stack([place * 0.7548776662466927 % 1, place * 0.5698402909980532 % 1])[None]


def drawn_normal(view: Tensor, alpha: Tensor, u: Tensor) -> Tensor:
    return torch.cat(sample_visible_normal(view.split(1, dim=1), alpha, u.split(1, dim=1)), dim=1)


def test_fresnel_limits():
    f0 = specular_f0(torch.tensor([0.9, 0.5, 0.1]).view(1, 3, 1, 1), torch.tensor([0.0, 1.0]).view(1, 1, 1, 2))
    assert torch.allclose(f0[..., 0], torch.full((1, 3, 1), 0.04))
    assert torch.allclose(f0[..., 1].flatten(), torch.tensor([0.9, 0.5, 0.1]))
    one = torch.ones(1, 1, 1, 1)
    assert torch.allclose(schlick(one, f0), f0)
    assert torch.allclose(schlick(0 * one, f0), torch.ones_like(f0))
    at_60 = 0.04 + 0.96 * 0.5**5
    assert torch.allclose(schlick(0.5 * one, f0)[..., 0], torch.full((1, 3, 1), at_60))


@pytest.mark.parametrize("alpha", ALPHAS)
def test_microfacets_cover_their_surface(alpha):
    half, angle = half_vectors()
    area = (ggx_distribution(half[:, 2:], torch.tensor(alpha)) * half[:, 2:] * angle).sum()
    assert abs(float(area) - 1) < 2e-3


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", VIEWS)
def test_density_integrates_to_one_and_fits_the_samples(alpha, cosine):
    view, rough = eye(cosine), torch.full((1, 1, 1), alpha, dtype=torch.float64)
    half, angle = half_vectors()
    along = (view * half).sum(1, keepdim=True)
    density = reflection_pdf(view[:, 2:], half[:, 2:], rough) * 4 * along.clamp_min(0)  # per half vector
    assert abs(float((density * angle).sum()) - 1) < 2e-4
    drawn = drawn_normal(view.expand(-1, -1, 40000), rough, samples())
    assert torch.allclose(drawn.norm(dim=1), torch.ones_like(drawn[:, 0]))
    for moment in (lambda h: h[:, 2:] ** 2, lambda h: h[:, 0:1], lambda h: h[:, 1:2] ** 2):
        expected = (moment(half) * density * angle).sum()
        assert abs(float(moment(drawn).mean() - expected)) < 4e-3


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", VIEWS)
def test_white_furnace(alpha, cosine):
    """With F = 1 no energy is gained; the sampled mean is the integral of D G2 / (4 cos v) over all light."""
    view, rough = eye(cosine), torch.full((1, 1, 1), alpha, dtype=torch.float64)
    half, angle = half_vectors()
    along = (view * half).sum(1, keepdim=True).clamp_min(0)
    cos_light = 2 * along * half[:, 2:] - view[:, 2:]
    shadowed = 1 / (1 + smith_lambda(view[:, 2:], rough) + smith_lambda(cos_light, rough))
    value = ggx_distribution(half[:, 2:], rough) * shadowed / (4 * view[:, 2:]) * 4 * along * (cos_light > 0)
    exact = float((value * angle).sum())
    drawn = drawn_normal(view.expand(-1, -1, 40000), rough, samples())
    light = 2 * (view * drawn).sum(1, keepdim=True) * drawn - view
    weight = masking_ratio(view[:, 2:], light[:, 2:], rough)
    assert weight.max() <= 1
    assert abs(float(weight.mean()) - exact) < 4e-3
    assert exact <= 1 + 2e-3
    if alpha == 0.05:
        assert exact > 0.93


def test_smooth_mirrors_and_rough_spreads():
    view, u = eye(0.5).expand(-1, -1, 40000), samples()
    smooth = drawn_normal(view, torch.zeros(1, 1, 1, dtype=torch.float64), u)
    assert torch.allclose(smooth[:, 2], torch.ones_like(smooth[:, 2]))
    spread = [drawn_normal(view, torch.full((1, 1, 1), a, dtype=torch.float64), u)[:, 2].mean() for a in ALPHAS]
    assert spread[0] > spread[1] > spread[2]


def test_tangent_frames_are_right_handed():
    normal = torch.nn.functional.normalize(torch.randn(1, 3, 500, generator=torch.Generator().manual_seed(0)), dim=1)
    normal = torch.cat([normal, torch.tensor([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]).T[None]], dim=2)
    tangent, bitangent = tangent_frame(normal)
    assert torch.allclose(torch.linalg.cross(tangent, bitangent, dim=1), normal, atol=1e-5)
    assert torch.allclose(tangent.norm(dim=1), torch.ones(1, 502), atol=1e-5)


def test_what_a_floor_mirrors_toward_the_eye():
    """Schlick at the view angle where it is smooth; less where it is rough."""
    camera = Camera.look_at((0.0, 2.0, 0.0), (0.0, 0.0, 3.0), size=(9, 9), fov_y=40.0)
    down = -camera.rays()[1][..., 1][:, None]
    g = GBuffer(
        camera=camera,
        depth=(2.0 / down) * (camera.rays()[1] * camera.forward[:, None, None]).sum(-1)[:, None],
        hit=torch.ones(1, 1, 9, 9, dtype=torch.bool),
        normal=torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1).expand(1, 3, 9, 9),
    )
    want = 0.04 + 0.96 * (1 - down) ** 5
    torch.testing.assert_close(specular_albedo(g), want, atol=1e-3, rtol=0.0)
    rough = specular_albedo(g.replace(roughness=torch.full_like(g.depth, 0.8)))
    assert (rough < 0.7 * want).all()
    assert specular_albedo(g.replace(hit=torch.zeros_like(g.hit))).max() == 0
