"""Where the camera opens when no view is named."""

from __future__ import annotations

import pytest

from gbufrt.commands.arguments.world import DayOptions

SEA = ("underwater", "landscape", "orbit")


@pytest.mark.parametrize(
    ("hour", "name"), [(None, "underwater"), (12.0, "underwater"), (7.0, "underwater"), (21.0, "landscape")]
)
def test_by_night_none_is_under_water(hour: float | None, name: str):
    """There is no light, and the picture would be black."""
    assert DayOptions(hour=hour).first(SEA) == name


def test_what_has_no_other_view_keeps_it():
    assert DayOptions(hour=0.0).first(("underwater",)) == "underwater"
    assert DayOptions(hour=0.0).first(("village", "lake")) == "village"
