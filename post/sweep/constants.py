"""Numbers that the torch references of the sweeps and their kernels share."""

from __future__ import annotations

BIAS = 1e-5  # of the depth: a surface must rise this far above the receiver's plane before it blocks anything
FIRST = 0.5  # pixels to the nearest tap
SNAP = 1e-6  # rounding by which a tap in the receiver's plane might seem to rise above it
FREE = 0.5  # sine of the elevation from which on nothing but a roof closes a direction
EDGE = 0.3  # of the rise since the tap before: how far a surface goes on, on average, past the last tap to meet it
LEDGE = 0.8  # of what a riser sends: what the tread below it sends to the next riser, where both see it edge-on
ALIKE = 0.7  # cosine between normals above which two surfaces count as parallel
FLATNESS = 0.1  # sine below which two taps lie in each other's planes

SECTORS = 30  # of equal cosine-weighted measure; fits a signed 32-bit mask
GROUPS = 6  # of sectors, one mean direction each
PER_GROUP = SECTORS // GROUPS
FIRST_BITS = sum(1 << (PER_GROUP * g) for g in range(GROUPS))
