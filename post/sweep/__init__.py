"""Slices of the hemisphere swept through the picture: arcs, sectors, thickness."""
