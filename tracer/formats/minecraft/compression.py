"""Decompression of what Minecraft compresses, within bounds: gzip, zlib, and the blocks of LZ4."""

from __future__ import annotations

import struct
import zlib

MAX_BYTES = 1 << 23  # of a chunk, decompressed; real ones have some 100 kB
GZIP = b"\x1f\x8b"
LZ4_MAGIC = b"LZ4Block"
LZ4_HEAD = struct.Struct("<BiiI")  # token, bytes compressed and decompressed, checksum
LZ4_STORED, LZ4_PACKED = 0x10, 0x20  # the upper half of the token; the lower is the compressor's level


def inflate(data: bytes, *, limit: int = MAX_BYTES) -> bytes:
    """Decompress zlib or gzip data; which of them it is, its first bytes say.

    Raises:
        ValueError: damaged, truncated, or more than ``limit`` bytes come out.
    """
    machine = zlib.decompressobj(zlib.MAX_WBITS | (16 if data[:2] == GZIP else 0))
    try:
        out = machine.decompress(data, limit + 1)
    except zlib.error as error:
        raise ValueError(f"compressed data is damaged ({error})") from None
    if len(out) > limit:
        raise ValueError(f"it decompresses to more than the {limit} bytes allowed")
    if not machine.eof:
        raise ValueError("compressed data is truncated")
    return out


def unpack_lz4(data: bytes, *, limit: int = MAX_BYTES) -> bytes:
    """Decompress the stream of lz4-java's ``LZ4BlockOutputStream``, which Minecraft writes since 1.20.5 if asked to.

    Each block has a head of its own; one of no bytes ends the stream. Checksums are not compared: what is damaged
    within a block and decompresses all the same is left for the reader of NBT to find.

    Raises:
        ValueError: damaged, truncated, or more than ``limit`` bytes come out; or lz4 is missing.
    """
    try:
        from lz4.block import LZ4BlockError, decompress
    except ImportError:
        raise ValueError("chunks in LZ4 need lz4: pip install gbufrt[worlds]") from None
    out, at, head = bytearray(), 0, len(LZ4_MAGIC) + LZ4_HEAD.size
    while True:
        if len(data) < at + head:
            raise ValueError("compressed data is truncated")
        token, packed, size, _ = LZ4_HEAD.unpack_from(data, at + len(LZ4_MAGIC))
        kind = token & 0xF0
        if data[at : at + len(LZ4_MAGIC)] != LZ4_MAGIC or kind not in (LZ4_STORED, LZ4_PACKED) or min(packed, size) < 0:
            raise ValueError("compressed data is damaged (no head of an LZ4 block)")
        if size == 0:
            return bytes(out)
        if len(out) + size > limit:
            raise ValueError(f"it decompresses to more than the {limit} bytes allowed")
        at += head
        block = data[at : at + packed]
        try:
            plain = block if kind == LZ4_STORED else decompress(block, uncompressed_size=size)
        except LZ4BlockError as error:
            raise ValueError(f"compressed data is damaged ({error})") from None
        if len(plain) != size:
            raise ValueError("compressed data is truncated")
        out += plain
        at += packed
