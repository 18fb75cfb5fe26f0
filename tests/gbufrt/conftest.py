"""G-buffers that several files of tests begin with."""

from __future__ import annotations

import boxes
import pytest

from gbufrt import GBuffer


@pytest.fixture
def moving() -> GBuffer:
    return boxes.frame(boxes.camera(dx=0.3), previous=boxes.camera()).gbuffer
