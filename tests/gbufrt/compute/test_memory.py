"""Large pages are asked for; memory that is freed goes back to the system, for large pictures alone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import boxes
import pytest
import torch

from gbufrt import Frame, Pass, Pipeline
from gbufrt.compute import memory

MEGA = 1 << 20


class Same(Pass):
    writes = frozenset({"ao"})

    def forward(self, frame: Frame) -> Frame:
        return frame.replace(ao=torch.ones_like(frame.gbuffer.depth))


def resident() -> int:
    """Bytes of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


glibcs = pytest.mark.skipif(memory._glibc() is None, reason="glibc's allocator")


@glibcs
def test_holes_between_blocks_are_given_back_for_large_pictures() -> None:
    del [torch.ones(4 * MEGA)][:]  # a block of this size, once freed, is kept, as are smaller ones from then on
    blocks = [torch.ones(MEGA) for _ in range(64)]
    kept = blocks[::2]
    del blocks
    memory.return_freed(torch.empty(1, 1, 540, 960))
    before = resident()
    memory.return_freed(torch.empty(1, 1, 1080, 1920))
    assert before - resident() > 64 * MEGA, "of 128"
    assert all(bool((block == 1).all()) for block in kept)


HALF = """
from pathlib import Path
import torch
from gbufrt.compute.memory import return_freed

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

del [torch.ones(4 << 20)][:]
return_freed(torch.empty(1, 1, 1080, 1920))
blocks = [torch.ones(4 << 20) for _ in range(16)]
before = resident()
kept = blocks[::2]
del blocks
print((before - resident()) >> 20)
"""


@glibcs
@pytest.mark.parametrize(("large_pages", "least", "most"), [("1", 120, 136), ("0", 0, 24)])
def test_with_large_pages_blocks_leave_no_holes(large_pages: str, least: int, most: int) -> None:
    """Of 16 blocks of 16 MB, every second one is freed."""
    environment = os.environ | {"THP_MEM_ALLOC_ENABLE": large_pages}
    run = subprocess.run([sys.executable, "-c", HALF], env=environment, capture_output=True, text=True, check=True)
    assert least <= int(run.stdout) <= most


def test_a_pipeline_does_so_once_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    given = list[torch.Tensor]()
    monkeypatch.setattr("gbufrt.pipeline.return_freed", given.append)
    frame = boxes.frame(boxes.camera((4, 6)))
    Pipeline(a=Pipeline(one=Same(), two=Same()), b=Same(), c=Pipeline(one=Same()))(frame)
    assert [plane.shape for plane in given] == [frame.gbuffer.depth.shape]


ADVISED = """
from pathlib import Path
import {imports}
import torch
kept = torch.ones(16 << 20)
print(any(line.startswith("VmFlags") and " hg" in line for line in Path("/proc/self/smaps").read_text().splitlines()))
"""


@pytest.mark.skipif(not Path("/sys/kernel/mm/transparent_hugepage").exists(), reason="a system without large pages")
@pytest.mark.parametrize(
    ("imports", "given", "advised"),
    [
        ("post", {}, "True\n"),
        ("gbufrt.commands.cli", {}, "True\n"),
        ("post", {memory.LARGE_PAGES: "0"}, "False\n"),
        ("torch, post", {}, "False\n"),
    ],
)
def test_large_pages_are_asked_for_unless_told_otherwise(imports: str, given: dict[str, str], advised: str) -> None:
    """No import makes a tensor, with which torch would have decided."""
    environment = {name: value for name, value in os.environ.items() if name != memory.LARGE_PAGES} | given
    code = ADVISED.format(imports=imports)
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout == advised
