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
