"""Numbers that the torch reference of the filters and its kernel share."""

from __future__ import annotations

B3 = (1 / 16, 1 / 4, 3 / 8, 1 / 4, 1 / 16)  # cubic B-spline
FLOOR = 1e-3  # of the local luminance: noise below this makes no edge
AT_EDGES = 0.5  # of sigma, where no neighbour is on the same surface
MIN_MEAN = 1e-4  # keeps relative measures finite in the dark
NARROWEST = 0.4  # of sigma, where there is no noise
MIN_CONTRAST = 0.01  # of the local luminance: smaller differences are no edge
ROUGHNESS_SCALE = 0.1  # a neighbour this much rougher or smoother counts 1/e
COARSE_POWER = 8.0  # of the cosine between normals, where neighbours are only told apart or averaged
SAME = 0.3  # edge weight above which a neighbour shows the same surface
KINDRED_DEPTH = 0.25  # sensitivity to depth per pixel footprint, where surfaces apart from one another share light
KINDRED_AWAY = -0.1  # cosine between normals below which they share none: a right angle, and room for rounding
LEAST_SHARE = 1e-6  # of a square that counts: keeps means over none finite

LUMA = (0.299, 0.587, 0.114)  # Rec. 601, of encoded colour
STRIDES = (1.0, 1.0, 1.0, 1.0, 1.5, 2.0, 2.0, 2.0, 4.0, 8.0)  # pixels a search step: fine near the pixel, then coarse

DEPTH, NX, NY, NZ, HIT, ROUGHNESS = range(6)  # channels of `edges.Surface.guide`

MOST_PLANES = 16  # of values that a filter takes on a GPU, whose threads have scratch memory of constant size
SHORTEST = 1e-6  # length below which a mean of unit vectors has no direction
