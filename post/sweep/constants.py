"""Numbers that the torch references of the sweeps and their kernels share."""

from __future__ import annotations

BIAS = 1e-5  # of the depth: a surface must rise this far above the receiver's plane before it occludes
FIRST = 0.5  # pixels to the nearest tap
SNAP = 1e-6  # rounding error that could lift a tap in the receiver's plane above it
FREE = 0.5  # sine of the elevation above which only a roof closes a direction
EDGE = 0.3  # of the rise since the previous tap: how far, on average, a surface extends past the last tap that hit it
LEDGE = 0.8  # of a riser's light: what the tread below it sends to the next riser, where both see the tread edge-on
ALIKE = 0.7  # cosine between normals above which two surfaces count as parallel
FLATNESS = 0.1  # sine below which two taps lie in each other's planes

SECTORS = 30  # of equal cosine-weighted measure; fits a signed 32-bit mask
GROUPS = 6  # of sectors, one mean direction each
PER_GROUP = SECTORS // GROUPS
FIRST_BITS = sum(1 << (PER_GROUP * g) for g in range(GROUPS))

SUMS = 8  # of each receiver, see `arcs.finish`
LIGHT = 3  # channels of light that follow where it is gathered
FOUND = 4  # of each receiver: visibility and bent normal
VANISHED = 1e-6  # square of the length below which a mean direction has none
MIN_FACING = 1e-3  # normals that tip past the silhouette are bent back to this cosine with the view

COSINES, SHARES = 33, 65  # size of `turns.table`: the shares it gives are right to 2e-4 (RMS)
UPRIGHT = 1e-3  # length of a normal's part across the ray below which all slices hold the same

STRIDES = (1, 2, 3)  # pixels between neighbours, one pass each: bodies are found from up to 6 pixels around

MOST_STEPS, MOST_RADII = 64, 4  # of a sweep on a GPU, whose threads have scratch memory of constant size

UNBOUNDED = 1e6  # limit of thickness, in place of "no end", as a multiple of the depth
