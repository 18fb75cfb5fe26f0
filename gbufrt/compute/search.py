"""Binary search in kernels, in as many steps whatever is found: which half goes on would be unpredictable branches."""

from __future__ import annotations

from gbufrt.compute.kernel import scalar


@scalar
def lower_bound(values, value):
    """Index of the first of ascending ``values`` ``(N,)`` that is not below a given one; N where all are."""
    first, count = 0, len(values)
    while count > 1:
        half = count // 2
        first = first + half if values[first + half - 1] < value else first
        count -= half
    return first + 1 if count and values[first] < value else first


@scalar
def upper_bound(values, value):
    """Index of the first of ascending ``values`` ``(N,)`` that is above a given one; N where none is."""
    first, count = 0, len(values)
    while count > 1:
        half = count // 2
        first = first + half if values[first + half - 1] <= value else first
        count -= half
    return first + 1 if count and values[first] <= value else first
