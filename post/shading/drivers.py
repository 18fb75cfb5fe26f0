"""Run the body of `post.shading.reflect_kernel` over pictures, on CPU threads."""

from __future__ import annotations

from gbufrt.compute.each import Each
from post.shading import reflect_kernel

reflect_each = Each(reflect_kernel.reflect)
