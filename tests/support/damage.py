"""Damage as files suffer it: cut short, bytes and bits flipped, absurd numbers, pieces lost and doubled."""

from __future__ import annotations

import random
import struct

ABSURD = (0x7FFFFFFF, 0xFFFFFFFF, 0x80000000, 100_000, 1 << 24, 0, 1, 65535)


def damaged(data: bytes, seed: int) -> bytes:
    """A damaged copy; the same seed, the same damage. The first 4 KB, where headers are, are hit more often."""
    rng, found = random.Random(seed), bytearray(data)

    def place() -> int:
        return rng.randrange(min(4096, len(found)) if rng.random() < 0.6 else len(found))

    at, kind = place(), seed % 5
    if kind == 0:
        return bytes(found[: rng.randrange(len(found))])
    if kind == 1:
        for _ in range(rng.randint(1, 4)):
            found[place()] = rng.randrange(256)
    elif kind == 2:
        found[at] ^= 1 << rng.randrange(8)
    elif kind == 3:
        found[at : at + 4] = struct.pack("<I", rng.choice(ABSURD))
    elif rng.random() < 0.5:
        del found[at : at + rng.randint(1, 64)]
    else:
        found[at:at] = found[at : at + rng.randint(1, 64)]
    return bytes(found)
