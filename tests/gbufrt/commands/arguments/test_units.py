"""``--units-per-metre``: which of the pipeline's lengths it scales, in files too."""

from __future__ import annotations

import math

import pytest

from gbufrt.commands.arguments.options import PassOptions
from gbufrt.commands.recipe import Recipe
from post import me1


def test_lengths_are_those_of_me1_in_such_units() -> None:
    recipe = Recipe.of(PassOptions(units_per_metre=100.0, preset="low"))
    want = me1("low", units_per_metre=100.0).all_tunables()
    assert recipe.build().all_tunables() == want != me1("low").all_tunables()


def test_files_keep_them_and_other_presets_too() -> None:
    recipe = Recipe.of(PassOptions(units_per_metre=100.0))
    kept = Recipe.of_notes({"pipeline": recipe.to_notes()})
    assert kept == recipe
    assert Recipe.of(PassOptions(preset="low"), kept).units_per_metre == 100.0
    assert "units_per_metre" not in Recipe().to_notes()


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.inf, math.nan])
def test_other_numbers_are_refused(wrong: float) -> None:
    with pytest.raises(ValueError, match="--units-per-metre must be above 0"):
        Recipe.of(PassOptions(units_per_metre=wrong))


def test_it_is_for_me1() -> None:
    with pytest.raises(ValueError, match="--units-per-metre is for me1"):
        Recipe.of(PassOptions(units_per_metre=2.0, pipeline="minecraft-rtx"))
