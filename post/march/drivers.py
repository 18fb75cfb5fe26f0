"""The bodies of `post.march.kernel` and `post.march.planes_kernel` over many rays or cells at a time."""

from __future__ import annotations

from gbufrt.compute.each import Each
from post.march import kernel, planes_kernel

march_each = Each(kernel.march)
planes_each, coarser_each = Each(planes_kernel.planes_cell), Each(planes_kernel.coarser_cell)
