"""The bodies of `post.march.kernel` and `post.march.hierarchy_kernel` over many rays or cells at a time."""

from __future__ import annotations

from gbufrt.compute.each import Each
from post.march import hierarchy_kernel, kernel

march_each = Each(kernel.march)
planes_each, coarser_each = Each(hierarchy_kernel.planes_cell), Each(hierarchy_kernel.coarser_cell)
