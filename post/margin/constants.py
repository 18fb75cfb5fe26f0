"""Numbers that the torch code of the margin and its kernel share."""

from __future__ import annotations

LEAST_FACING = 1e-3  # planes at more grazing angles than this are not continued past the border
