"""Subcommands of `gbufrt`, one file each: the only place that imports both tracer and post.

A process that runs them asks for large pages, unless the environment says otherwise; torch reads that with its first
tensor, so it stands here. See `gbufrt.compute.memory`.
"""

import os

os.environ.setdefault("THP_MEM_ALLOC_ENABLE", "1")
