"""Numbers that the torch references of the display and its kernels share."""

from __future__ import annotations

AGX_INSET = (
    (0.842479062253094, 0.0784335999999992, 0.0792237451477643),
    (0.0423282422610123, 0.878468636469772, 0.0791661274605434),
    (0.0423756549057051, 0.0784336, 0.879142973793104),
)
AGX_MIN_EV, AGX_MAX_EV = -12.47393, 4.026069  # 10 stops below and 6.5 above middle grey, log2
AGX_CURVE = (-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5)  # by rising power
AGX_DISPLAY_GAMMA = 2.2

ACES_INPUT = ((0.59719, 0.35458, 0.04823), (0.07600, 0.90834, 0.01566), (0.02840, 0.13383, 0.83777))
ACES_OUTPUT = ((1.60475, -0.53108, -0.07367), (-0.10208, 1.10813, -0.00605), (-0.00327, -0.07276, 1.07602))

NEUTRAL_START = 0.8 - 0.04  # startCompression
NEUTRAL_DESATURATION = 0.15
NEUTRAL_F90 = 0.04
TINY = 1e-10

BINS = 256  # of the histogram of log luminance
DARKEST, BRIGHTEST = -24.0, 24.0  # log2 of luminance that it tells apart
STRIP = 16  # rows that are counted by themselves, so that the sum does not depend on the number of threads

SRGB_KNEE, SRGB_SLOPE = 0.0031308, 12.92  # IEC 61966-2-1
SRGB_OFFSET, SRGB_GAMMA = 0.055, 2.4
