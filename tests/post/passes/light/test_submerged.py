"""Sky light of what lies under water."""

from __future__ import annotations

import boxes
import torch
from torch import Tensor

from gbufrt import Frame, Pipeline
from post import SSGI, me1
from post.passes.light.submerged import Submerged

OPEN = 0.2  # of the sky, above the surface


def pool() -> Frame:
    """A room seen through water on the left, and through a pane on the right: one unit behind the surface."""
    behind = boxes.frame()
    g = behind.gbuffer
    left = torch.arange(g.camera.width) < g.camera.width // 2
    front = g.replace(depth=g.depth - 1.0, thickness=torch.where(left, 9.0, 0.1).expand_as(g.depth).contiguous())
    return behind.replace(gbuffer=front, behind=behind, sky_visibility=torch.full_like(g.depth, OPEN))


def test_what_lies_under_water_has_as_much_of_the_sky_as_the_surface():
    frame = pool()
    behind = Submerged()(frame).behind
    assert behind is not None
    under = behind.gbuffer.hit & (frame.gbuffer.thickness > 1.0)  # pyright: ignore[reportOptionalOperand]
    assert bool(under.any())
    torch.testing.assert_close(behind.read("surface_sky"), torch.where(under, OPEN, 1.0))
    assert Submerged()(frame.replace(sky_visibility=None)).behind is frame.behind


def test_indirect_light_under_a_surface_that_sees_no_sky_is_that_of_a_dark_sky():
    frame = boxes.frame()
    closed = SSGI()(frame.write("surface_sky", torch.zeros_like(frame.gbuffer.depth)))
    dark = SSGI()(frame.replace(ambient=torch.zeros_like(frame.read("ambient"))))
    torch.testing.assert_close(closed.read("gi"), dark.read("gi"))
    assert float(closed.read("sky_visibility")[frame.gbuffer.hit].max()) == 0.0
    assert closed.ambient is frame.ambient
    assert float(dark.read("gi").mean()) < 0.9 * float(SSGI()(frame).read("gi").mean())


def test_pools_in_closed_rooms_are_dark():
    """The preset hands the surface's openness down, at half size too."""
    for preset in ("low", "high"):
        stages = {name: me1(preset).stages[name] for name in ("submerged", "behind")}
        pipeline = Pipeline(given={"sky_visibility"}, **stages)  # pyright: ignore[reportArgumentType]
        frame = pool()
        found, _ = pipeline(frame.replace(sky_visibility=torch.zeros_like(frame.gbuffer.depth)))
        assert found.behind is not None
        sky = found.behind.read("sky_visibility")
        quarter = frame.gbuffer.camera.width // 4  # the wavelets mix what lies close to the middle
        wet, dry = (shown(part) for part in (slice(None, quarter), slice(-quarter, None)))
        assert float(sky[wet].mean()) < 0.01 < 0.1 < float(sky[dry].mean()), preset


def shown(columns: slice) -> Tensor:
    """``(B, 1, H, W)`` bool: pixels of these columns that show a surface."""
    hit = pool().gbuffer.hit
    return hit & torch.zeros_like(hit).index_fill(3, torch.arange(hit.shape[3])[columns], True)
