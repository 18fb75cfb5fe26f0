"""What a runner holds in memory, and the pages of the command line's memory."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gbufrt import Frame, Pipeline, TemporalPass
from gbufrt.commands.session import Runner
from gbufrt.specimen import specimen


def test_a_runner_lets_go_of_a_state_when_it_is_read() -> None:
    held = []

    class Count(TemporalPass):
        def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
            held.append((state, runner.state))
            return frame, (0 if state is None else state) + 1

    runner = Runner(Pipeline(count=Count()), warmup=0)
    still = specimen().still()
    for index in range(3):
        runner(still.replace(index=index))
    assert held == [(None, None), (1, None), (2, None)]


ADVISED = """
import gbufrt.commands.cli, torch
from pathlib import Path
kept = torch.ones(16 << 20)
print(any(line.startswith("VmFlags") and " hg" in line for line in Path("/proc/self/smaps").read_text().splitlines()))
"""


@pytest.mark.skipif(not Path("/sys/kernel/mm/transparent_hugepage").exists(), reason="a system without large pages")
@pytest.mark.parametrize(("given", "advised"), [({}, "True\n"), ({"THP_MEM_ALLOC_ENABLE": "0"}, "False\n")])
def test_the_command_line_asks_for_large_pages_unless_told_otherwise(given: dict[str, str], advised: str) -> None:
    """No import before it makes a tensor, with which torch would have decided."""
    environment = {name: value for name, value in os.environ.items() if name != "THP_MEM_ALLOC_ENABLE"} | given
    run = subprocess.run([sys.executable, "-c", ADVISED], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout == advised
