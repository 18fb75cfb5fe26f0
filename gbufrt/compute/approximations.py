"""Scalar functions for kernels, in float32 without calls, so that a loop over them becomes vector instructions."""

from __future__ import annotations

import numpy as np

from gbufrt.compute.bodies import inlined

LOG2_E = np.float32(1.4426950408889634)
LOWEST, HIGHEST = np.float32(-126.0), np.float32(127.0)  # exponents of normal numbers
HALF, ONE = np.float32(0.5), np.float32(1.0)
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


@inlined
def log2(x):
    """The logarithm of a positive normal number to base 2, to 6e-7, and to 3e-7 of its value near 1."""
    bits = np.float32(x).view(np.int32)
    exponent = (bits - ROOT_HALF_BITS) >> MANTISSA_BITS
    m = np.int32(bits - (exponent << MANTISSA_BITS)).view(np.float32) - ONE
    part = ((((((L7 * m + L6) * m + L5) * m + L4) * m + L3) * m + L2) * m + L1) * m + L0
    return np.float32(exponent) + m * part
