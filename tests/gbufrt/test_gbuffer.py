"""G-buffers and frames: their form, their channels by name, devices and types."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import CHANNELS, SIGNALS, Frame, GBuffer


def test_good_buffers_pass(moving):
    parallel, sky = boxes.frame(boxes.camera(orthographic=True)), boxes.frame(boxes=boxes.ROOM + 500.0)
    for good in (moving, parallel.gbuffer, sky.gbuffer):
        assert good.validate() is None  # what it finds, it raises


def test_absent_channels_are_none():
    g = boxes.frame().gbuffer
    bare = GBuffer(camera=g.camera, depth=g.depth, hit=g.hit, normal=g.normal)
    assert bare.present == ("depth", "hit", "normal")
    assert bare.albedo is None
    bare.validate()


@pytest.mark.parametrize(
    ("name", "change", "error", "message"),
    [
        ("depth", lambda t: t[0], ValueError, "add the batch dimension"),
        ("depth", lambda t: t[0, 0], ValueError, "add batch and channel"),
        ("normal", lambda t: t.permute(0, 2, 3, 1), ValueError, "channels-last"),
        ("albedo", lambda t: torch.cat([t, t[:, :1]], 1), ValueError, r"leave alpha out: x\[:, :3\]"),
        ("albedo", lambda t: t[:, :1], ValueError, r"make three of one: x\.expand\(-1, 3, -1, -1\)"),
        ("depth", lambda t: t.expand(-1, 3, -1, -1), ValueError, r"take one of three alike: x\[:, :1\]"),
        ("motion", lambda t: t[:, :1], ValueError, r"motion must be \(1,2,72,96\).*got \(1,1,72,96\)"),
        ("depth", lambda t: t.half(), TypeError, "float32"),
        ("hit", lambda t: t.float(), TypeError, "hit must be bool"),
        ("object_id", lambda t: t.float(), TypeError, "int32"),
        ("albedo", lambda t: t.to("meta"), ValueError, "albedo is on meta"),
        ("depth", lambda t: t.numpy(), TypeError, "torch.Tensor"),
        ("normal", lambda t: t.double(), TypeError, r"normal is float64 but depth is float32.*\.float\(\)"),
    ],
)
def test_form_is_checked_when_built(moving, name, change, error, message):
    with pytest.raises(error, match=message):
        moving.replace(**{name: change(getattr(moving, name))})


def test_moves_between_types_and_keeps_ids(moving):
    double = moving.to(torch.float64)
    assert double.depth.dtype == torch.float64
    assert double.camera.intrinsics.dtype == torch.float64
    assert double.hit.dtype == torch.bool
    assert double.object_id.dtype == torch.int32
    assert moving.depth.dtype == torch.float32


def test_frame_reads_and_writes_by_name():
    f = boxes.frame()
    ao = torch.ones_like(f.gbuffer.depth)
    assert f.write("ao", ao).read("ao") is ao
    assert f.write("glow", ao).read("glow") is ao
    assert f.write("glow", ao).extra["glow"] is ao
    assert f.read("depth") is f.gbuffer.depth
    with pytest.raises(ValueError, match="no 'gi'"):
        f.read("gi")
    with pytest.raises(ValueError, match="G-buffer channel"):
        f.write("depth", ao)
    with pytest.raises(ValueError, match="name of a known channel"):
        f.replace(extra={"ao": ao})
    with pytest.raises(ValueError, match="cut must be"):
        f.replace(cut=torch.zeros(2, dtype=torch.bool))


def test_as_previous_keeps_no_chain():
    f = boxes.frame()
    f = f.replace(previous=f, color=f.radiance, composite=f.radiance)
    assert f.as_previous().previous is None
    assert f.as_previous().color is None
    assert f.as_previous().composite is not None
    assert f.as_previous().gbuffer.albedo is None, "only geometry"


def test_tables_describe_every_field():
    assert set(CHANNELS).isdisjoint(SIGNALS)
    assert all(row.meaning for row in (*CHANNELS.values(), *SIGNALS.values()))
    assert {"depth", "hit", "normal"} == {name for name, row in CHANNELS.items() if row.required}
    assert isinstance(boxes.frame(), Frame)
