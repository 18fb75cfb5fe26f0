"""Shared by the reference and the kernel of reflections."""

from __future__ import annotations

import math

BORDER = 0.005  # of the picture's height: hits nearer to its border than this fade out
HIDDEN_SHARE = 0.5  # share of the radiance of the surface next to a hidden side, as a guess of the side's
CONTINUED_SHARE = 1.0  # likewise of a surface that goes on behind what hides it: a mirror shows where it would end
FIREFLY = 16.0  # times the frame's mean luminance, over roughness: limit of one sample
GUESSED = 4.0  # times that mean: limit of a hidden side, since lamps seldom continue behind their occluders
OPEN = 0.9  # visibility of the sky that counts as all of it: what is missing there is noise, or the picture's border
FULL_SHARE = 0.125  # of the light: surfaces that reflect this much or more take all samples
FILTERED = 0.5  # perceptual roughness from which half as many rays do: filters average them over neighbours
BROAD = 0.2  # perceptual roughness from which bright samples are many, and filters average them
LIMIT = 2.0  # of lone bright pixels of narrower lobes: times the brightest of the pixels around
UNKNOWN = -1.0  # less than any light: around lie no other pixels of such lobes
GLOSSY = 0.5  # perceptual roughness from which one direction tells nothing of what a dielectric mirrors in a mirror
NEXT = 1.25  # pixels within which a ray that goes behind something is not yet known to: neighbours are one surface
ROWS = 36  # of a guess of what lies beyond the picture, from the zenith to the nadir
ROW_SLOPE = math.tan(math.pi / ROWS / 2)  # of the directions of the two rows next to the horizon
