"""What the reference and the kernel of `post.march` share: how rays end, and to what precision."""

from __future__ import annotations

LEFT, HIT, BLOCKED, SPENT = 0, 1, 2, 3
BEHIND = 4  # goes on behind a pixel's solid: no end of a ray
TOLERANCE = 3e-4  # of nearness: how far behind a plane a ray must be to have crossed it; above depth's own error
