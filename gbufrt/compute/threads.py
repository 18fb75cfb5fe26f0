"""How many threads compute, and how they wait. Imports neither torch nor numba before they are needed.

Both hand work to OpenMP threads, which by default spin for milliseconds after each piece of work. Spinning occupies
cores that other processes could use. With more busy threads than cores, a thread that has work waits for one that has
none: beside five busy processes on two cores a frame took ten times its fair share. But to wake a thread that sleeps
takes longer than many an operation on a small picture.
"""

from __future__ import annotations

import os
from functools import cache

CHOICES = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT", "KMP_BLOCKTIME")
"""Environment variables for how OpenMP waits; where the user has set one, nothing is changed."""

# Of GNU's OpenMP: some 20 microseconds. `me1` low takes 240 ms with 0, 200 with 1000 and 190 with 3000, and beside five
# busy processes 1.1, 1.2 and 1.6 times its fair share.
SPINS = 1000


def wait_briefly() -> None:
    """Let idle threads sleep soon, unless the environment says otherwise.

    OpenMP reads this once, when torch is loaded: it does nothing in a process that imported torch before gbufrt (set
    ``OMP_WAIT_POLICY=PASSIVE`` and ``GOMP_SPINCOUNT=1000`` there). Processes that this one starts inherit it.
    """
    if not any(name in os.environ for name in CHOICES):
        os.environ |= {"OMP_WAIT_POLICY": "PASSIVE", "GOMP_SPINCOUNT": str(SPINS)}


def threads() -> int:
    """How many threads a driver may use: torch's own number, but no more than numba has.

    numba is limited to it as well, so that it wakes no thread that has no work.

    Raises:
        RuntimeError: kernels ran before this process was forked. GNU's OpenMP would end it without an exception, for
            which a pool waits for ever.
    """
    import numba
    import torch

    if _started_in() != os.getpid() and numba.threading_layer() == "omp":  # pyright: ignore
        raise RuntimeError(
            "kernels ran before this process was forked, and OpenMP's threads do not outlive a fork: start processes "
            "by spawn or forkserver, as multiprocessing.get_context('spawn') and "
            "DataLoader(multiprocessing_context='spawn') do, or fork before the first frame"
        )
    count = max(1, min(torch.get_num_threads(), numba.config.NUMBA_NUM_THREADS))  # pyright: ignore
    numba.set_num_threads(count)
    return count


@cache
def _started_in() -> int:
    """Start numba's threads, once, as the first kernel would, but keep torch's number of threads: in which process.

    numba's OpenMP layer sets that number as well. A forked process knows the answer of the one it comes from.
    """
    import numba
    import torch

    count = torch.get_num_threads()
    numba.get_num_threads()
    torch.set_num_threads(count)
    return os.getpid()
