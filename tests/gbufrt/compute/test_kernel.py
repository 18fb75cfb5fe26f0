"""What compiled kernels share with the rest of a process."""

from __future__ import annotations

import os
import subprocess
import sys

CODE = """
import numba, torch
torch.set_num_threads(1)
from gbufrt.compute import kernel

@numba.njit(parallel=True)
def count(n):
    total = 0
    for i in numba.prange(n):
        total += i
    return total

assert kernel.threads() == 1
assert count(10) == 45
print(kernel.threads(), torch.get_num_threads(), numba.get_num_threads())
torch.set_num_threads(2)
print(kernel.threads(), torch.get_num_threads(), numba.get_num_threads())
"""


def test_kernels_take_as_many_threads_as_torch_and_leave_it_its_number():
    env = {**os.environ, "NUMBA_NUM_THREADS": "2"}
    found = subprocess.run([sys.executable, "-c", CODE], env=env, capture_output=True, text=True, check=True)
    assert found.stdout.split("\n")[:2] == ["1 1 1", "2 2 2"]
