"""Scalar functions for kernels, without calls, so that a loop over them becomes vector instructions."""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.bodies import contracted, inlined

LOG2_E = np.float32(1.4426950408889634)
LOWEST, HIGHEST = np.float32(-126.0), np.float32(127.0)  # exponents of normal numbers
ZERO, HALF, ONE, FOUR = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(4.0)
TINY = np.float32(1e-20)
QUARTER, HALF_TURN, FOLD = np.float32(math.pi / 2), np.float32(math.pi), np.float32(math.tan(math.pi / 8))
ROUNDING = np.float32(1.5 * 2**23)  # added to a small number, leaves its nearest whole number in the lowest bits
MANTISSA_BITS, BIAS = np.int32(23), np.int32(127)
ROOT_HALF_BITS = np.int32(0x3F3504F3)  # of the square root of 1/2

# Polynomials by Chebyshev interpolation: 2^t in [-1/2, 1/2]; log2(1 + m) / m from sqrt(1/2) - 1 to sqrt(2) - 1.
E0, E1, E2 = np.float32(1.00000012), np.float32(0.693147182), np.float32(0.240221068)
E3, E4, E5 = np.float32(0.0555035696), np.float32(0.00967603177), np.float32(0.00133908633)
L0, L1, L2, L3 = np.float32(1.44269502), np.float32(-0.721352935), np.float32(0.480916709), np.float32(-0.360225171)
L4, L5, L6, L7 = np.float32(0.287288874), np.float32(-0.249271825), np.float32(0.232652575), np.float32(-0.14275974)


@inlined
def exp2(x):
    """2 to the power x, to 3e-7 of its value; at least 2^-126, at most 2^127."""
    x = min(max(x, LOWEST), HIGHEST)
    whole = np.floor(x + HALF)
    t = x - whole
    part = ((((E5 * t + E4) * t + E3) * t + E2) * t + E1) * t + E0
    return np.int32((np.int32(whole) + BIAS) << MANTISSA_BITS).view(np.float32) * part


@contracted
@inlined
def falling_exp2(x):
    """2 to the power x of at most 0, to 3e-7 of its value; at least 2^-126. Cheaper than `exp2`."""
    shifted = max(x, LOWEST) + ROUNDING
    t = max(x, LOWEST) - (shifted - ROUNDING)
    part = ((((E5 * t + E4) * t + E3) * t + E2) * t + E1) * t + E0
    whole = np.int32(np.float32(shifted).view(np.int32) << MANTISSA_BITS)
    return np.int32(np.float32(part).view(np.int32) + whole).view(np.float32)


@inlined
def log2(x):
    """The logarithm of a positive normal number to base 2, to 6e-7, and to 3e-7 of its value near 1."""
    bits = np.float32(x).view(np.int32)
    exponent = (bits - ROOT_HALF_BITS) >> MANTISSA_BITS
    m = np.int32(bits - (exponent << MANTISSA_BITS)).view(np.float32) - ONE
    part = ((((((L7 * m + L6) * m + L5) * m + L4) * m + L3) * m + L2) * m + L1) * m + L0
    return np.float32(exponent) + m * part


@inlined
def atan2(y, x):
    """The angle of (x, y), to 2e-7 of its value, in the precision of its arguments.

    Source: S. L. Moshier, Cephes library, atanf: an odd polynomial up to the tangent of an eighth of pi; the addition
    theorem reduces larger tangents to that range.
    """
    across, along = abs(y), abs(x)
    small, large = min(across, along), max(across, along)
    folds = small > FOLD * large
    t = (small - large if folds else small) / max(small + large if folds else large, TINY)
    z = t * t
    value = ((np.float32(8.05374449538e-2) * z - np.float32(1.38776856032e-1)) * z + np.float32(1.99777106478e-1)) * z
    angle = t + t * z * (value - np.float32(3.33329491539e-1)) + (HALF * QUARTER if folds else ZERO)
    angle = QUARTER - angle if across > along else angle
    angle = HALF_TURN - angle if x < ZERO else angle
    return -angle if y < ZERO else angle


@inlined
def cos_sin(turns):
    """The cosine and sine of a number of whole turns, to 2e-7.

    Source: S. L. Moshier, Cephes library, sinf and cosf: polynomials up to an eighth of a turn.
    """
    quarters = np.floor(FOUR * turns + HALF)
    angle, which = (FOUR * turns - quarters) * QUARTER, np.int32(quarters)
    z = angle * angle
    sine = ((np.float32(-1.9515295891e-4) * z + np.float32(8.3321608736e-3)) * z - np.float32(1.6666654611e-1)) * z
    sine = sine * angle + angle
    cosine = (np.float32(2.443315711809948e-5) * z - np.float32(1.388731625493765e-3)) * z
    cosine = (cosine + np.float32(4.166664568298827e-2)) * z * z - HALF * z + ONE
    cosine, sine = (sine, cosine) if which & 1 else (cosine, sine)
    return (-cosine if (which + 1) & 2 else cosine), (-sine if which & 2 else sine)
