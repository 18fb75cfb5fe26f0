"""EXR: what a frame takes in memory while it is read, and after."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import boxes
import torch

from gbufrt import Frame
from gbufrt.files.exr import read_exr, write_exr

SIZE = (180, 320)


def in_bytes(frame: Frame) -> int:
    layers = [frame] if frame.behind is None else [frame, frame.behind]
    stores = [layer.read(name).untyped_storage() for layer in layers for name in layer.present]
    return sum({store.data_ptr(): store.nbytes() for store in stores}.values())


def test_reading_takes_little_more_than_the_frame(tmp_path: Path) -> None:
    camera = boxes.camera(SIZE)
    write_exr(tmp_path / "a.exr", boxes.frame(camera).replace(behind=boxes.frame(camera)))
    read_exr(tmp_path / "a.exr")
    tracemalloc.start()
    try:
        frame = read_exr(tmp_path / "a.exr")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    picture = 3 * 4 * SIZE[0] * SIZE[1]  # in R, G and B, for viewers
    assert in_bytes(frame) < peak < 1.25 * in_bytes(frame) + picture


def test_normals_that_are_the_same_take_their_memory_once(tmp_path: Path) -> None:
    frame = boxes.frame(boxes.camera((9, 16)))
    normal = frame.gbuffer.normal
    other = torch.where(normal == 0, -normal, normal)  # the same numbers, but zeros have another sign
    for geo, is_shared in ((normal.clone(), True), (other, False), (-normal, False)):
        write_exr(tmp_path / "a.exr", frame.replace(gbuffer=frame.gbuffer.replace(normal_geo=geo)))
        g = read_exr(tmp_path / "a.exr").gbuffer
        assert g.normal_geo is not None
        assert (g.normal_geo is g.normal) == is_shared
        assert torch.equal(g.normal_geo.view(torch.int32), geo.view(torch.int32))
