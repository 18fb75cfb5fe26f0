"""Binary search in kernels."""

from __future__ import annotations

from gbufrt.compute.kernel import scalar


@scalar
def lower_bound(values, value):
    """Index of the first of ascending ``values`` ``(N,)`` that is not below a given one; N where all are."""
    begin, end = 0, len(values)
    while begin < end:
        middle = (begin + end) // 2
        if values[middle] < value:
            begin = middle + 1
        else:
            end = middle
    return begin


@scalar
def upper_bound(values, value):
    """Index of the first of ascending ``values`` ``(N,)`` that is above a given one; N where none is."""
    begin, end = 0, len(values)
    while begin < end:
        middle = (begin + end) // 2
        if values[middle] <= value:
            begin = middle + 1
        else:
            end = middle
    return begin
