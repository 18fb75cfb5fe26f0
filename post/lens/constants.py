"""Numbers that the torch references of the lens and its kernels share."""

from __future__ import annotations

CONFIDENT = 1e-3  # share of known background from which on it fills what a near edge disoccludes
BRIGHT = 1.0  # of the picture's mean level: pixels this bright count half where the background is guessed
FINEST = 0.25  # pixels between the radii of the two sharpest layers
TINY = 1e-6  # coverage below this is rounding
EDGE = 0.5  # pixels beyond the radius at which a disc ends; it is whole a pixel further in
MOST_LAYERS, MOST_CHANNELS = 64, 3  # on a GPU, whose threads have scratch memory of constant size

LANDING_TOLERANCE = 0.25  # pixels by which a point may miss the pixel that it should cover, plus
LANDING_RELATIVE = 0.1  # of the distance it moved, because neighbours on one surface do not move quite alike
ALIKE = 0.25  # pixels: paths that differ by less are one
STILL = 0.5  # pixels: paths shorter than this are not blurred (Guertin et al. 2014)
OWN_WEIGHT = 1e-3  # keeps a pixel's own colour where nothing else is known
OVERSHOOT = 0.1  # of the range around it, by which a pixel may leave that range when sharpened: more would ring
STEEP = 0.75  # pixels by which the motion of neighbours on one body differs at most: it turns by 40 degrees
TILT = 0.35  # share of its turning by which a body may be sheared and still be taken to turn
MOST_SINE = 0.9  # of the angle by which anything turns in a frame
UNTURNED = 1e-9  # squared turning of a frame below which there is none
