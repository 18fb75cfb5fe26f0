"""Debug views: a picture for everything in a frame, and each shows what it claims to."""

from __future__ import annotations

from pathlib import Path

import boxes
import numpy as np
import pytest
import torch
from PIL import Image

from gbufrt import Frame
from gbufrt.files.color_maps import to_srgb, viridis
from gbufrt.files.png import to_pil, write_png
from gbufrt.files.views import GAP, LABEL, contact_sheet, debug_names, debug_view, layers_sheet, sheet_of

SIZE = (20, 31)


def whole_frame() -> Frame:
    frame = boxes.frame(boxes.camera(SIZE), previous=boxes.camera(SIZE, dx=0.2))
    light, one = frame.read("radiance"), frame.read("roughness")
    return frame.replace(
        ao=one,
        sky_visibility=one,
        bent_normal=frame.gbuffer.normal,
        gi=light,
        reflection=light,
        reflection_confidence=one,
        reflection_distance=one * 3,
        composite=light,
        color=light,
        exposure=torch.full((1, 1, 1, 1), 0.7),
        image=light.clamp(0, 1),
        behind=boxes.frame(boxes.camera(SIZE)),
        extra={"gi_history": one * 16, "gi_variance": one, "moments": light[:, :2], "tile": torch.zeros(1, 5, 2, 3)},
    )


def test_everything_has_a_view():
    frame = whole_frame()
    names = debug_names(frame)
    assert set(names) == {*frame.present, "behind"} - {"exposure"}
    for name in (*names, "behind.depth", "behind.radiance"):
        view = debug_view(frame, name)
        assert view.shape[:2] == (1, 3), name
        assert view.dtype == torch.float32, name
        assert bool(torch.isfinite(view).all()), name
        assert 0 <= float(view.min()) <= float(view.max()) <= 1, name
        if name not in ("environment", "tile"):
            assert view.shape[-2:] == SIZE, name


def test_unknown_views_list_the_known():
    with pytest.raises(ValueError, match=r"no view 'depht'; it has depth, hit, normal"):
        debug_view(boxes.frame(boxes.camera(SIZE)), "depht")
    with pytest.raises(ValueError, match="no view 'behind'"):
        debug_view(boxes.frame(boxes.camera(SIZE)), "behind")


def test_near_is_brighter_than_far_and_sky_is_black():
    frame = boxes.frame(boxes.camera((40, 60)))
    view, depth, hit = debug_view(frame, "depth").mean(1, keepdim=True), frame.gbuffer.depth, frame.gbuffer.hit
    assert not bool(hit.all())
    assert float(view[~hit].max()) == 0
    order = depth[hit].argsort()
    assert bool((view[hit][order].diff() <= 2e-3).all())  # the colour map's own brightness is monotone to a hair


def test_motion_shows_direction_and_length():
    frame = boxes.frame(boxes.camera(SIZE))

    def shown(x: float, y: float) -> torch.Tensor:
        motion = torch.tensor([x, y])[None, :, None, None].expand(1, 2, *SIZE)
        g = frame.gbuffer.replace(motion=motion.contiguous())
        return debug_view(frame.replace(gbuffer=g), "motion", motion_scale=8.0)[0, :, 0, 0]

    assert float(shown(0.0, 0.0).max()) == 0
    assert torch.allclose(shown(8.0, 0.0), shown(80.0, 0.0))
    assert torch.allclose(shown(2.0, 0.0) * 2, shown(8.0, 0.0))
    assert float((shown(8.0, 0.0) - shown(-8.0, 0.0)).abs().max()) > 0.5
    assert torch.allclose(shown(8.0, 0.0), torch.tensor([1.0, 0.25, 0.25]), atol=1e-5)


def test_ids_are_told_apart():
    frame = boxes.frame(boxes.camera(SIZE))
    ids = torch.arange(SIZE[0] * SIZE[1]).view(1, 1, *SIZE).int()
    view = debug_view(frame.replace(gbuffer=frame.gbuffer.replace(object_id=ids)), "object_id")[0].flatten(1)
    neighbours = (view[:, 1:] - view[:, :-1]).abs().amax(0)
    assert float(neighbours.min()) > 0.1


def test_light_views_share_one_exposure():
    frame = whole_frame()
    assert torch.equal(debug_view(frame, "gi"), debug_view(frame, "color"))
    assert bool((debug_view(frame, "gi") >= debug_view(frame.replace(gi=frame.read("gi") * 0.5), "gi")).all())


def test_colours_pass_through_srgb_only():
    albedo = debug_view(whole_frame(), "albedo")
    assert torch.allclose(albedo, to_srgb(whole_frame().read("albedo")))
    assert torch.equal(debug_view(whole_frame(), "image"), whole_frame().read("image"))
    grey = to_srgb(torch.full((1, 3, 1, 1), 0.5))
    assert grey.flatten().tolist() == pytest.approx([0.735357] * 3, abs=1e-5)


def test_viridis_ends_where_it_should():
    ends = viridis(torch.tensor([0.0, 1.0]).view(2, 1, 1, 1))[:, :, 0, 0]
    wanted = torch.tensor([[0.267, 0.005, 0.329], [0.993, 0.906, 0.144]])
    assert torch.allclose(ends, wanted, atol=0.02)


def test_sky_alone_and_nan():
    sky = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[2:3] + 500.0)
    assert not bool(sky.gbuffer.hit.any())
    sky = sky.write("gi", torch.full((1, 3, *SIZE), torch.nan))
    for name in debug_names(sky):
        assert bool(torch.isfinite(debug_view(sky, name)).all()), name


def test_batch_is_shown_one_by_one():
    frame = whole_frame()
    twice = torch.cat([frame.read("depth"), frame.read("depth") * 3])
    camera = boxes.camera(SIZE)
    two = type(camera).from_intrinsics(
        camera.intrinsics.expand(2, 3, 3), camera.world_from_view.expand(2, 4, 4), size=SIZE, far=1000.0
    )
    hit, normal = frame.gbuffer.hit.expand(2, -1, -1, -1), frame.gbuffer.normal.expand(2, -1, -1, -1)
    both = Frame(gbuffer=type(frame.gbuffer)(camera=two, depth=twice, hit=hit, normal=normal))
    assert torch.allclose(debug_view(both, "depth")[:1], debug_view(frame, "depth"), atol=1e-6)


def test_contact_sheet_and_pictures():
    frame = whole_frame()
    sheet = contact_sheet(frame, columns=4, width=31)
    rows = -(-len(debug_names(frame)) // 4)
    assert sheet.size == (4 * 31 + 3 * GAP, rows * (20 + LABEL))
    assert to_pil(torch.tensor([0.0, 0.5, 1.0]).view(3, 1, 1)).getpixel((0, 0)) == (0, 128, 255)
    with pytest.raises(ValueError, match=r"picture must be \(3,H,W\)"):
        to_pil(torch.zeros(2, 3, 4, 4))


@pytest.mark.parametrize("size", [(5, 7), (64, 33), (1, 1)])
def test_png_of_16_bits(tmp_path: Path, size: tuple[int, int]):
    picture = torch.rand(1, 3, *size, generator=torch.Generator().manual_seed(1)) * 1.2 - 0.1
    picture.view(-1)[0] = torch.nan
    write_png(tmp_path / "a.png", picture, bits=16)
    with Image.open(tmp_path / "a.png") as found:
        found.load()  # checks every chunk
        assert found.size == (size[1], size[0])
        assert "srgb" in found.info
        assert np.abs(np.asarray(found).astype(int) - np.asarray(to_pil(picture)).astype(int)).max() <= 1
    with pytest.raises(ValueError, match="bits must be 8, or 16 for a tensor, got 12"):
        write_png(tmp_path / "b.png", picture, bits=12)
    write_png(tmp_path / "c.png", picture)
    assert "srgb" in Image.open(tmp_path / "c.png").info
    oiio = pytest.importorskip("OpenImageIO", reason="OpenImageIO is not installed: pip install gbufrt[dev]")
    levels = np.asarray(oiio.ImageBuf(str(tmp_path / "a.png")).get_pixels(oiio.UINT16)).astype(int)
    expected = (picture[0].nan_to_num(0.0).clamp(0, 1) * 65535).round().permute(1, 2, 0).numpy()
    assert np.array_equal(levels, expected)


def test_two_layers_stand_side_by_side():
    frame = boxes.frame(boxes.camera((16, 24)))
    with pytest.raises(ValueError, match="has one layer"):
        layers_sheet(frame)
    behind = boxes.frame(boxes.camera((16, 24), dx=0.5))
    both = debug_view(frame.replace(behind=behind), "layers.normal")
    assert both.shape == (1, 3, 16, 48)
    assert torch.equal(both[..., :24], debug_view(frame, "normal"))
    assert torch.equal(both[..., 24:], debug_view(behind, "normal"))
    assert layers_sheet(frame.replace(behind=behind)).width == 2 * 640 + GAP
    with pytest.raises(ValueError, match="no view 'colour'"):
        debug_view(frame.replace(behind=behind), "layers.colour")


@pytest.mark.parametrize("width", [5, 100])
def test_a_long_name_ends_where_its_picture_does(width):
    black = Image.new("RGB", (width, width))
    page = sheet_of({"AfterAFolder.WithALongName." * 4 + "RGB": black, " ": black}, width=width)
    label = np.asarray(page)[:LABEL]
    assert not np.ptp(label[:, width:])
    if width > 5:
        assert np.ptp(label[:, width - 30 : width])
