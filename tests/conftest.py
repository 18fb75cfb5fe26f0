"""The order of the tests, by which two workers share what both would do otherwise."""

from __future__ import annotations

import pytest

ORDER = {"tests/tracer": 0, "tests/post": 2}  # the rest lies between


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The tracer first, the passes last: ``--dist worksteal`` hands each worker one half, in order.

    Kernels take minutes to compile. One worker then compiles those of the tracer while the other compiles those of the
    passes, and each reads from the cache what the other has made.
    """
    items.sort(key=lambda item: ORDER.get("/".join(item.nodeid.split("/")[:2]), 1))
