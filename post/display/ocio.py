"""Views of OpenColorIO configs, on the CPU and without a gradient: for finished pictures."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

CONFIGS = {"aces-1.3": "cg-config-v2.2.0_aces-v1.3_ocio-v2.4", "aces-2.0": "cg-config-v4.0.0_aces-v2.0_ocio-v2.5"}
"""OpenColorIO's built-in configs by the names that they have here."""
REC709 = ("Linear Rec.709 (sRGB)", "lin_rec709_srgb", "lin_rec709", "Linear Rec.709", "lin_srgb")
"""What configs call our light."""


def is_config(operator: str) -> bool:
    """Whether a tone curve's name is a config's: a built-in one or a file."""
    return operator in CONFIGS or operator.endswith((".ocio", ".ocioz"))


def check_view(operator: str, view: str = "") -> None:
    """Raise ValueError unless a config and its view can be used here; see `ocio_view`."""
    if operator not in CONFIGS and not Path(operator).is_file():
        raise ValueError(f"operator: there is no config {operator}; check the path, or use {' or '.join(CONFIGS)}")
    if find_spec("PyOpenColorIO") is None:
        raise ValueError(f"operator {operator!r} needs OpenColorIO: pip install 'gbufrt[color]'")
    _processor(operator, view)


def ocio_view(light: Tensor, operator: str, view: str = "") -> Tensor:
    """``(B, 3, H, W)`` scene-linear Rec. 709 as a config's view shows it.

    Args:
        light: exposed already.
        operator: of `CONFIGS`, or path of a config.
        view: ``"VIEW"`` of the config's default display, ``"DISPLAY/VIEW"``, or empty for the default.

    Returns:
        Display-linear light in [0, 1], whose sRGB encoding is what the view gives for the display.

    Raises:
        ValueError: a gradient is wanted; OpenColorIO or the config is missing; the config is damaged or has no such
            view, or no linear Rec. 709.
    """
    from kornia.color import rgb_to_linear_rgb  # late: kornia takes most of a second to import

    check_view(operator, view)
    if torch.is_grad_enabled() and light.requires_grad:
        raise ValueError(f"operator {operator!r} has no gradient; use agx or another curve, or detach the light")
    pixels = light.detach().to("cpu", torch.float32).permute(0, 2, 3, 1).contiguous().numpy().copy()
    processor = _processor(operator, view)
    for picture in pixels:
        processor.applyRGB(picture)
    shown = torch.from_numpy(np.nan_to_num(pixels)).permute(0, 3, 1, 2).clamp(0, 1)
    return rgb_to_linear_rgb(shown).to(light)


@lru_cache(maxsize=8)
def _processor(operator: str, view: str) -> Any:
    ocio: Any = import_module("PyOpenColorIO")  # its stubs name nothing

    try:
        builtin = CONFIGS.get(operator)
        make = ocio.Config.CreateFromBuiltinConfig if builtin else ocio.Config.CreateFromFile
        config = make(builtin or operator)
        source = next((space for name in REC709 if (space := config.getColorSpace(name)) is not None), None)
        if source is None:
            raise ValueError(f"config {operator} has no colour space called {' or '.join(REC709)}; add an alias")
        display, name = _chosen(config, operator, view)
        transform = ocio.DisplayViewTransform(src=source.getName(), display=display, view=name)
        return config.getProcessor(transform).getDefaultCPUProcessor()
    except ocio.Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise ValueError(f"config {operator} cannot be used: {reason}") from error


def _chosen(config: Any, operator: str, view: str) -> tuple[str, str]:
    displays, default = list(config.getDisplays()), config.getDefaultDisplay()
    known = {(display, name) for display in displays for name in config.getViews(display)}
    display, slash, name = view.rpartition("/")
    chosen = (display if slash else default, name or config.getDefaultView(display if slash else default))
    if view and (default, view) in known:  # a view with a slash in its name
        chosen = (default, view)
    if chosen not in known:
        shown = chosen[0] if chosen[0] in displays else default
        raise ValueError(
            f"view {view!r} is not in config {operator}; {shown} has {', '.join(config.getViews(shown))}; as "
            f"DISPLAY/VIEW those of {', '.join(d for d in displays if d != shown) or 'no other display'}"
        )
    return chosen
