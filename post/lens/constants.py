"""Numbers that the torch reference of the lens and its kernel share."""

from __future__ import annotations

CONFIDENT = 1e-3  # share of known background from which on it fills what a near edge disoccludes
BRIGHT = 1.0  # of the picture's mean level: pixels this bright count half where the background is guessed
FINEST = 0.25  # pixels between the radii of the two sharpest layers
TINY = 1e-6  # coverage below this is rounding
EDGE = 0.5  # pixels beyond the radius at which a disc ends; it is whole a pixel further in
