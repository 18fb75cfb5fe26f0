"""Shared by the references and the kernels of `post.march`: how rays end, to what precision, and what is no surface."""

from __future__ import annotations

LEFT, HIT, BLOCKED, SPENT = 0, 1, 2, 3
BEHIND = 4  # continues behind a pixel's solid: the ray does not end
TOLERANCE = 3e-4  # of nearness: how far behind a plane a ray must be to have crossed it; above depth's own error
NOTHING = 1e30  # a back that no ray is in front of, as nearness; its negative: a front that no ray is behind
STEEPEST = 0.02  # least cosine with the view: surfaces closer to edge-on are treated as if at this one
GRAZING = 1e-3  # that of perspective cameras
NEAREST, TINY = 1e-9, 1e-30  # view z, and a change of nearness per pixel, to divide by
