"""A tiny writer of MagicaVoxel files, for tests."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

from tracer.formats.vox.scene_graph import read_vox
from tracer.scene.world import World


def chunk(name: str, content: bytes = b"", children: bytes = b"") -> bytes:
    """One chunk."""
    return name.encode() + struct.pack("<ii", len(content), len(children)) + content + children


def text(value: str) -> bytes:
    """A string after its length."""
    return struct.pack("<i", len(value)) + value.encode()


def attributes(**pairs: str) -> bytes:
    """Pairs of strings after their number."""
    return struct.pack("<i", len(pairs)) + b"".join(text(k) + text(v) for k, v in pairs.items())


def model(size: tuple[int, int, int], voxels: Sequence[tuple[int, int, int, int]]) -> bytes:
    """SIZE and XYZI."""
    return chunk("SIZE", struct.pack("<iii", *size)) + chunk(
        "XYZI", struct.pack("<i", len(voxels)) + b"".join(bytes(v) for v in voxels)
    )


def palette(colors: Mapping[int, tuple[int, int, int]]) -> bytes:
    """RGBA with some colours by their index, the rest grey."""
    table = [(128, 128, 128, 255)] * 256
    for index, (r, g, b) in colors.items():
        table[index - 1] = (r, g, b, 255)
    return chunk("RGBA", b"".join(bytes(c) for c in table))


def transform(node: int, child: int, *, layer: int = -1, hidden: bool = False, **frame: str) -> bytes:
    """nTRN; ``_r`` and ``_t`` go into its one frame."""
    own = attributes(_hidden="1") if hidden else attributes()
    return chunk(
        "nTRN", struct.pack("<i", node) + own + struct.pack("<iiii", child, -1, layer, 1) + attributes(**frame)
    )


def group(node: int, *children: int) -> bytes:
    """nGRP."""
    return chunk(
        "nGRP", struct.pack("<i", node) + attributes() + struct.pack(f"<i{len(children)}i", len(children), *children)
    )


def shape(node: int, model_id: int) -> bytes:
    """nSHP."""
    return chunk("nSHP", struct.pack("<i", node) + attributes() + struct.pack("<ii", 1, model_id) + attributes())


def layer(number: int, *, hidden: bool) -> bytes:
    """LAYR."""
    return chunk("LAYR", struct.pack("<i", number) + attributes(_hidden="1" if hidden else "0") + struct.pack("<i", -1))


def material(index: int, **told: str) -> bytes:
    """MATL."""
    return chunk("MATL", struct.pack("<i", index) + attributes(**told))


def old_material(index: int, kind: int, weight: float, properties: dict[int, float]) -> bytes:
    """MATT."""
    bits = sum(1 << b for b in properties)
    values = b"".join(struct.pack("<f", properties[b]) for b in sorted(properties) if b < 7)
    return chunk("MATT", struct.pack("<iifi", index, kind, weight, bits) + values)


def file(*chunks: bytes, version: int = 200) -> bytes:
    """A whole file."""
    return b"VOX " + struct.pack("<i", version) + chunk("MAIN", b"", b"".join(chunks))


STEPS = ((0, 0, 0, 1), (1, 0, 0, 2), (0, 1, 0, 3), (0, 0, 1, 4))  # an origin and one voxel along each axis
MODEL = model((3, 3, 3), STEPS)


def read(tmp_path: Path, *chunks: bytes, version: int = 200) -> World:
    """The world that gbufrt reads from such a file."""
    path = tmp_path / "made.vox"
    path.write_bytes(file(*chunks, version=version))
    return read_vox(path)
