"""The compiled form of what rays traverse against its torch definition."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera
from post.march.constants import NOTHING
from post.march.op import hierarchy_cpu
from post.march.rays import depth_hierarchy

CAMERAS = {
    "perspective": boxes.camera((72, 96)),
    "orthographic": boxes.camera((72, 96), orthographic=True),
    "jittered": boxes.camera((72, 96)).with_jitter((0.3, -0.4)),
    "odd": boxes.camera((127, 73)),
    "odd orthographic": boxes.camera((127, 73), orthographic=True),
    "two": boxes.cameras(2, (61, 80)),
    "deep": boxes.camera((9, 300)),
    "telephoto": replace(boxes.camera((72, 96)), intrinsics=torch.tensor([[[6e3, 0, -8e3], [0, 7e3, 40], [0, 0, 1]]])),
    "one row": boxes.camera((1, 9)),
    "one column": boxes.camera((9, 1)),
    "one pixel": boxes.camera((1, 1)),
}
THICKNESS = {"measured": None, "assumed": 0.3, "one tensor": torch.tensor(0.3)}


def chance(camera: Camera, channels: int) -> Tensor:
    return torch.rand((camera.batch, channels, *camera.size), generator=torch.Generator().manual_seed(channels))


def scene(camera: Camera) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Boxes whose normals are bent, as far as to face away, with holes that show the sky."""
    g = boxes.frame(camera).gbuffer
    bent = g.normal + 1.6 * (chance(camera, 3) - 0.5) * (chance(camera, 1) > 0.5)
    hit = g.hit & (chance(camera, 1) > 0.1)
    normal = torch.where(g.hit, torch.nn.functional.normalize(bent, dim=1), 0.0)
    return (g.depth, normal, camera), {"hit": hit, "thickness": g.thickness}


def assert_close(got: Tensor, want: Tensor) -> None:
    torch.testing.assert_close(got, want, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("thickness", THICKNESS)
@pytest.mark.parametrize("case", CAMERAS)
def test_kernel_equals_definition(case: str, thickness: str) -> None:
    inputs, given = scene(CAMERAS[case])
    given |= {} if thickness == "measured" else {"thickness": THICKNESS[thickness]}
    got, want = (depth_hierarchy(*inputs, **given, compiled=form) for form in (True, False))
    assert_close(got.planes, want.planes)
    assert_close(got.pyramid, want.pyramid)
    assert torch.equal(got.table, want.table)
    if CAMERAS[case].height > 60:
        sky = want.planes[..., 0] == -NOTHING
        assert 0.05 < float(sky.float().mean()) < 0.9, "some pixels show the sky"
        assert float(want.planes[~sky].std(0).min()) > 1e-4, "every plane varies"
        other = depth_hierarchy(*inputs, **given | {"thickness": 0.9})
        assert not torch.allclose(other.planes[..., 3], want.planes[..., 3]), "thickness counts"


@pytest.mark.parametrize("compiled", [True, False])
def test_cells_bound_their_pixels(compiled: bool) -> None:
    inputs, given = scene(CAMERAS["odd"])
    planes, pyramid, table = depth_hierarchy(*inputs, **given, compiled=compiled)
    q, across, down, back = planes[0].unbind(-1)
    front = torch.where(q == -NOTHING, q, q + 0.5 * (across.abs() + down.abs()))
    y, x = torch.meshgrid(*map(torch.arange, q.shape), indexing="ij")
    for level, (start, width) in enumerate(table.tolist()[1:], 1):
        cell = pyramid[0, start + (y >> level) * width + (x >> level)]
        assert bool((cell[..., 0] >= front - 1e-6).all())
        assert bool((cell[..., 1] <= back).all())
    assert_close(pyramid[0, -1], torch.stack([front.max(), back.min()]))


def test_the_operator_follows_torchs_rules() -> None:
    (depth, normal, camera), given = scene(CAMERAS["two"])
    for solid in (given["thickness"], depth[:, :0]):
        pictures = (depth, normal, given["hit"], solid, 0.5, camera.lens, camera.rotation_to_view)
        for parallel in (False, True):
            utils = ("test_schema", "test_faketensor")
            torch.library.opcheck(hierarchy_cpu, (*pictures, parallel), test_utils=utils)
