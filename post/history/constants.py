"""Numbers that the torch reference of the histories and its kernels share."""

from __future__ import annotations

FAST_BLEND = 0.8
FAST_FRAMES = (1 + FAST_BLEND) / (1 - FAST_BLEND)  # of as many a plain mean has the noise of the fast history
MOMENTS_BLEND = 0.8  # SVGF: alpha 0.2
YOUNG = 4  # frames: below this age, variance comes from the neighbours
NOTICED = 0.05  # of the light: smaller changes are left to the mean, since cuts and resampling bring such themselves
ANY_WAY = -2.0  # below every cosine between normals: planes are then not compared, but depths alone
KEPT = 1e-3  # of a bilinear footprint: less than this on the surface is no history
STILL = 1e-3  # pixels: motion so near to a whole number is one
FARTHEST = 1e6  # pixels: motion beyond it is as good as this
WHOLE = 0.999  # of the bilinear footprint: above this, all four pixels show the surface
POOL = 3  # pixels to each side over which variance is pooled

WINDOW = -4.0  # exp of this times squared pixels: a Blackman-Harris window narrowed until it nears a pixel's area
BRIGHTEST = 1.0 - 1e-6  # of tone-mapped luminance
IN_FRONT = 0.98  # share of the least depth of a pixel's plane in 3x3, below which a neighbour is another surface
BODY = 1.1  # of the depth of the nearest pixel in 3x3: what is in front and up to as deep is one body
GRAZING = 1e-6  # cosine: planes that are seen so edge-on would divide by zero
SHARP = 4.0  # frames of a TAA history that is read halfway between pixels in one direction each time; 2 in both
