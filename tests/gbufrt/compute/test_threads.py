"""Threads that wait soon sleep, whichever package is imported first, and users keep the last word."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from gbufrt.compute.threads import CHOICES, SPINS


def spins(code: str, **environment: str) -> set[str]:
    """How often threads look for work before they sleep, as each OpenMP that was loaded tells it."""
    env = {k: v for k, v in os.environ.items() if k not in CHOICES} | {"OMP_DISPLAY_ENV": "VERBOSE", **environment}
    told = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True).stderr
    if "GOMP_SPINCOUNT" not in told:
        pytest.skip("torch comes with an OpenMP other than GNU's here")
    return set(re.findall(r"GOMP_SPINCOUNT = '(\w+)'", told))


@pytest.mark.parametrize("package", ["gbufrt.camera", "tracer.scene.world", "post.passes.light.gtao"])
def test_threads_that_wait_soon_sleep(package: str):
    assert spins(f"import {package}") == {str(SPINS)}


def test_a_choice_of_the_user_stays():
    assert spins("import post", GOMP_SPINCOUNT="1234") == {"1234"}
    assert spins("import post", OMP_WAIT_POLICY="ACTIVE").isdisjoint({"0", str(SPINS)})


FORKED = """
import os, sys, torch
from gbufrt.camera import Camera
from post import gtao

def frame():
    camera = Camera.look_at([0, 0, 0], [0, 0, 1], size=(4, 4))
    torch.set_num_threads(1)  # as in workers of a DataLoader
    return gtao(torch.ones(1, 1, 4, 4), torch.tensor([0.0, 0, -1]).view(1, 3, 1, 1).expand(1, 3, 4, 4), camera)

if sys.argv[1] == "after":
    frame()
child = os.fork()
if child == 0:
    try:
        frame()
    except RuntimeError as error:
        print(error, flush=True)
        os._exit(3)
    os._exit(0)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_process_forked_after_kernels_ran_is_told_so_and_one_forked_before_runs_them():
    def told(when: str) -> str:
        return subprocess.run([sys.executable, "-c", FORKED, when], capture_output=True, text=True, check=True).stdout

    assert told("before").split() == ["0"]
    assert re.fullmatch(r"kernels ran before this process was forked.*spawn.*\n3\n", told("after"))
