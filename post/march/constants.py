"""Shared by the reference and the kernel of `post.march`: how rays end, and to what precision."""

from __future__ import annotations

LEFT, HIT, BLOCKED, SPENT = 0, 1, 2, 3
BEHIND = 4  # continues behind a pixel's solid: the ray does not end
TOLERANCE = 3e-4  # of nearness: how far behind a plane a ray must be to have crossed it; above depth's own error
