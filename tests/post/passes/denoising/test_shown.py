"""What a pixel shows, and what of it must not be mixed."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import GBuffer
from post import denoise
from post.passes.denoising.shown import Shown, completed, reflectance_of, visible_layer
from post.shading.composite_op import specular_albedo

SIZE = (36, 48)


def tiled(roughness: float) -> GBuffer:
    """Black and white tiles, fixed to the world."""
    g = boxes.frame(boxes.camera(SIZE)).gbuffer
    check = torch.floor(g.camera.to_world(g.points_view()) * 2 + 1e-3).sum(1, keepdim=True) % 2
    albedo = torch.where(g.hit, torch.where(check > 0, 0.8, 0.02), 0.0).expand(-1, 3, -1, -1)
    return g.replace(albedo=albedo, emission=None, roughness=torch.full_like(g.depth, roughness))


def test_highlights_do_not_mix_dark_tiles_with_pale_ones(monkeypatch: pytest.MonkeyPatch):
    g, generator = tiled(0.2), torch.Generator().manual_seed(11)
    share = specular_albedo(g)
    assert g.albedo is not None
    light = torch.where(g.hit, 4 * share + (1 - share) * g.albedo, 0.7)  # highlights brighter than the rest
    noisy = light * torch.empty(g.depth.shape).exponential_(generator=generator)
    apart = denoise(noisy, g)[0]
    monkeypatch.setattr("post.passes.denoising.denoise.in_mirrors", lambda _, shown, *rest: shown._replace(glossy=None))
    mixed = denoise(noisy, g)[0]
    error = [float((x - light)[g.hit.expand_as(light)].square().mean().sqrt()) for x in (apart, mixed)]
    assert error[0] < 0.8 * error[1]


def test_the_share_of_a_highlight_is_great_on_dark_and_smooth_surfaces_alone():
    def share(g: GBuffer) -> tuple[float, float]:
        shown: Shown = visible_layer(g, None, reflectance_of(g, specular=True), specular=True)
        assert shown.glossy is not None
        assert g.albedo is not None
        dark = g.hit & (g.albedo[:, :1] < 0.5)
        return float(shown.glossy[dark].mean()), float(shown.glossy[g.hit & ~dark].mean())

    assert share(tiled(0.2))[0] > 0.4
    assert share(tiled(0.2))[1] < 0.2
    assert share(tiled(1.0)) == (0.0, 0.0)  # a wide lobe gathers light as the diffuse one does
    g = tiled(0.2)
    assert visible_layer(g, None, reflectance_of(g, specular=False)).glossy is None


def test_metals_of_black_albedo_count_as_white():
    """Renderers that write diffuse albedo alone write black for metals."""
    g = tiled(0.2)
    assert g.albedo is not None
    metal = torch.zeros_like(g.depth)
    metal[..., :24] = 1.0
    given = g.replace(metallic=metal, albedo=torch.where(g.albedo > 0.5, g.albedo, 0.0))
    found = completed(given, None).albedo
    assert found is not None
    assert given.albedo is not None
    white = (metal > 0) & (given.albedo == 0)
    assert torch.equal(found, torch.where(white, 1.0, given.albedo))
    assert bool(white.any())
