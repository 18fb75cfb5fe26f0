"""Kernels of the passes are compiled by a second process, once, and only where that pays."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from gbufrt.commands import ahead
from gbufrt.commands.recipe import Recipe
from gbufrt.compute import cache
from post import me1


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Commands of the processes that were started; each takes a moment, and fails."""
    commands: list[list[str]] = []
    start = subprocess.Popen

    def record(command: list[str], **options: object) -> subprocess.Popen[bytes]:
        commands.append(command)
        return start([sys.executable, "-c", "import time; time.sleep(0.5); raise SystemExit(1)"])

    monkeypatch.setattr(ahead.subprocess, "Popen", record)
    monkeypatch.setattr("gbufrt.commands.busy.cores", lambda: 2)
    monkeypatch.setattr("gbufrt.compute.kernel.missing", lambda dispatcher: True)
    return commands


def test_a_second_process_compiles_what_is_missing(started: list[list[str]]):
    recipe = Recipe(preset="low", without=("taa",))
    told: list[cache.Compilation] = []
    with cache.watch(told.append):
        wait = ahead.compile_ahead(recipe, recipe.build(), "cpu")
        wait()
        wait()
    begun, ended = told
    assert begun.seconds is None, "that it waits is told, once"
    assert ended.seconds is not None
    (command,) = started
    assert command[:3] == [sys.executable, "-m", "gbufrt.commands.ahead"]
    assert Recipe.of_notes({"pipeline": json.loads(command[3])}) == recipe


def test_nothing_starts_where_it_does_not_pay(started: list[list[str]], monkeypatch: pytest.MonkeyPatch):
    recipe = Recipe(preset="low")
    pipeline = recipe.build()
    ahead.compile_ahead(recipe, pipeline, "cuda")()
    ahead.compile_ahead(recipe, pipeline.without("ao", "gi", "behind"), "cpu")()
    monkeypatch.setattr("gbufrt.commands.busy.cores", lambda: 1)
    ahead.compile_ahead(recipe, pipeline, "cpu")()
    monkeypatch.setattr("gbufrt.commands.busy.cores", lambda: 2)
    monkeypatch.setattr("gbufrt.compute.kernel.missing", lambda dispatcher: False)
    ahead.compile_ahead(recipe, pipeline, "cpu")()
    assert not started


def test_a_kernel_is_missing_until_it_has_run():
    from post.sweep.drivers import sweep_all

    me1("low").without("reflection").compile()
    assert not sweep_all.missing
    assert not cache.missing(object())
