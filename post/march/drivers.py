"""The body of `post.march.kernel` over many rays at a time."""

from __future__ import annotations

from gbufrt.compute.each import Each
from post.march import kernel

march_each = Each(kernel.march)
