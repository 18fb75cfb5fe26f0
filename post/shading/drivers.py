"""Run the bodies of reflections over pictures, on CPU threads or on a GPU."""

from __future__ import annotations

from gbufrt.compute.each import Each
from post.shading import fireflies_kernel, reflect_kernel

reflect_each, calm_each = Each(reflect_kernel.reflect), Each(fireflies_kernel.calmed)
