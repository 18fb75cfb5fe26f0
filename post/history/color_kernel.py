"""Colours of one pixel, as scalar bodies."""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import inlined
from gbufrt.luminance import REC709

QUARTER, HALF = np.float32(0.25), np.float32(0.5)
RED, GREEN, BLUE = (np.float32(share) for share in REC709)


@inlined
def luminance(r, g, b):
    """Of linear Rec. 709."""
    return RED * r + GREEN * g + BLUE * b


@inlined
def ycocg(r, g, b):
    """Luma, orange against blue, and green against both."""
    return QUARTER * r + HALF * g + QUARTER * b, HALF * (r - b), HALF * g - QUARTER * (r + b)
