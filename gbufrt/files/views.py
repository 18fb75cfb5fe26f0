"""Debug views: any channel or signal of a frame as a picture that a person can read."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import torch
from PIL import Image, ImageDraw, ImageFont, ImageOps
from torch import Tensor

from gbufrt.files.color_maps import flow, ids, signed, to_srgb, viridis
from gbufrt.files.exr import best_picture
from gbufrt.files.png import to_pil
from gbufrt.frame import Frame

MOTION_SCALE = 16.0  # pixels a frame that are shown at full brightness
LENGTH_SCALE = 32.0  # frames of history at the end of the colour map
LABEL = 22  # pixels over each picture of a sheet
GAP = 6  # pixels between pictures of a sheet
MIDDLE_GREY = 0.18
NEAR_POWER = 1.5  # steeper than the plain reciprocal, which leaves the ends of the colour map unused
LIGHTS = {
    *("emission", "radiance", "ambient", "environment", "gi", "reflection", "composite", "color"),
    *("diffuse", "indirect", "specular", "replayed_diffuse", "replayed_specular", "cached_diffuse"),
}
DIRECTIONS = {"normal", "normal_geo", "bent_normal"}
SHARES = {"hit", "roughness", "metallic", "opacity", "ao", "sky_visibility", "reflection_confidence", "replayed"}
COLOURS = {"albedo", "transmittance", "image"}


def debug_names(frame: Frame) -> tuple[str, ...]:
    """What `debug_view` can show of this frame, ``behind`` last."""
    names = tuple(name for name in frame.present if name != "exposure" and frame.read(name).ndim == 4)
    return names if frame.behind is None else (*names, "behind")


def debug_view(frame: Frame, name: str, *, motion_scale: float = MOTION_SCALE) -> Tensor:
    """One channel or signal as a picture.

    Light is exposed alike in all views of a frame and passed through a simple tone curve; distances go from near
    (bright) to far (dark), ids get colours of their own, motion shows direction as hue and length as brightness.

    Args:
        frame: whose channel or signal.
        name: one of `debug_names`; ``behind.<name>``; or ``layers.<name>``, the surface in front on the left and what
            lies behind it on the right, twice as wide.
        motion_scale: pixels a frame at which motion is fully bright.

    Returns:
        ``(B, 3, H, W)`` display-referred, in [0, 1].

    Raises:
        ValueError: the frame has no such thing; the message lists what it has.
    """
    head, _, rest = name.partition(".")
    if head == "behind" and frame.behind is not None and name not in frame.extra:
        return debug_view(frame.behind, rest, motion_scale=motion_scale) if rest else _behind(frame, frame.behind)
    if head == "layers" and frame.behind is not None and rest:
        sides = (debug_view(layer, rest, motion_scale=motion_scale) for layer in (frame, frame.behind))
        return torch.cat(list(sides), dim=3)
    known = debug_names(frame)
    if name not in known:
        raise ValueError(f"the frame has no view {name!r}; it has {', '.join(known)}")
    tensor = frame.read(name).detach()
    tensor = tensor if tensor.is_floating_point() else tensor.to(torch.int64)
    return _shower(name, tensor, motion_scale)(frame, tensor).nan_to_num(0.0).float().clamp(0, 1)


def contact_sheet(frame: Frame, *, columns: int = 5, width: int = 320, names: tuple[str, ...] = ()) -> Image.Image:
    """All views of the first frame of a batch on one page, each with its name.

    Args:
        frame: what to show.
        columns: views per row.
        width: of one view in pixels.
        names: which views; by default all of them.
    """
    pictures = {name: to_pil(debug_view(frame, name)[:1]) for name in names or debug_names(frame)}
    return sheet_of(pictures, columns=columns, width=width)


def layers_sheet(frame: Frame, *, columns: int = 2, width: int = 640) -> Image.Image:
    """Every channel that both layers have, the surface in front on the left and what lies behind it on the right.

    So Minecraft RTX keeps its primary and its transmissive layer, side by side in one picture a channel.

    Raises:
        ValueError: nothing lies behind.
    """
    if frame.behind is None:
        raise ValueError("the frame has one layer: nothing transmissive is seen, or its renderer knows no layer behind")
    both = [name for name in debug_names(frame.behind) if name in debug_names(frame) and name != "environment"]
    pictures = {name: to_pil(debug_view(frame, f"layers.{name}")[:1]) for name in both}
    return sheet_of(pictures, columns=columns, width=width)


def sheet_of(pictures: Mapping[str, Image.Image], *, columns: int = 5, width: int = 320) -> Image.Image:
    """Pictures on one page, each with its name, or the end that fits; the first one's shape is that of a cell."""
    first, font = next(iter(pictures.values())), ImageFont.load_default(LABEL - 9)
    height, columns = max(1, round(width * first.height / first.width)), min(columns, len(pictures))
    step_x, step_y = width + GAP, height + LABEL
    page = Image.new("RGB", (columns * step_x - GAP, math.ceil(len(pictures) / columns) * step_y), (24, 24, 24))
    pen = ImageDraw.Draw(page)
    for place, (name, picture) in enumerate(pictures.items()):
        x, y = place % columns * step_x, place // columns * step_y
        page.paste(ImageOps.contain(picture, (width, height)), (x, y + LABEL))
        while name and pen.textlength(name, font) > width - 4:  # the ends tell passes and values
            name = f"…{name.lstrip('…')[1:]}".removesuffix("…")
        pen.text((x + 4, y + 2), name, fill=(235, 235, 235), font=font)
    return page


def _shower(name: str, tensor: Tensor, motion_scale: float) -> Callable[[Frame, Tensor], Tensor]:
    """How to show a channel: by its name if that is known, otherwise by its shape and type."""
    components = tensor.shape[1]
    whole = not tensor.is_floating_point() and name not in SHARES
    if name == "image":
        return lambda frame, t: t
    if name in COLOURS:
        return lambda frame, t: to_srgb(t)
    if name in LIGHTS or (components == 3 and name not in DIRECTIONS):
        return _light
    if name in DIRECTIONS:
        return lambda frame, t: torch.where(t.square().sum(1, keepdim=True) > 0, t * 0.5 + 0.5, 0.0)
    if name == "shadow":
        return lambda frame, t: torch.cat([t, t[:, 1:]], dim=1)
    if components == 2:
        return lambda frame, t: flow(t / motion_scale)
    if name in SHARES:
        return lambda frame, t: t.to(torch.float32).expand(-1, 3, -1, -1)
    if whole:
        return lambda frame, t: ids(t)
    if name.endswith("motion_z"):
        return lambda frame, t: signed(t)
    if name.endswith(("history", "length")):
        return lambda frame, t: viridis(t / LENGTH_SCALE)
    if name in ("depth", "reflection_distance", "thickness"):
        return _near
    return _ramp


def _near(frame: Frame, distance: Tensor) -> Tensor:
    """The median distance lies half way along the colour map: even steps look even, and no far plane is needed."""
    hit = frame.gbuffer.hit & (distance > 0) & torch.isfinite(distance)
    pictures = []
    for some, valid in zip(distance, hit, strict=True):
        middle = some[valid].median() if bool(valid.any()) else some.new_ones(())
        pictures.append(torch.where(valid, 1 / (1 + (some.abs() / middle) ** NEAR_POWER), 0.0))
    return torch.where(hit, viridis(torch.stack(pictures)), 0.0)


def _ramp(frame: Frame, value: Tensor) -> Tensor:
    """Unknown numbers: the first component, from zero to its 99th percentile."""
    value = value[:, :1].to(torch.float32).nan_to_num(0.0, 0.0, 0.0).abs()
    top = torch.quantile(value.flatten(1)[:, :: max(1, value[0].numel() // 100_000)], 0.99, dim=1)
    return viridis(value / top.clamp_min(1e-12)[:, None, None, None])


def _light(frame: Frame, radiance: Tensor) -> Tensor:
    """Reinhard's curve after one exposure for all light of the frame, so that views can be compared."""
    exposed = radiance.nan_to_num(0.0).clamp_min(0) * _exposure(frame)
    return to_srgb(exposed / (1 + exposed))


def _exposure(frame: Frame) -> Tensor | float:
    if frame.exposure is not None:
        return frame.exposure
    picture = frame.composite if frame.composite is not None else best_picture(frame.replace(color=None))
    grey = picture.detach().mean(1).flatten(1).clamp_min(1e-4).nan_to_num(1e-4).log().mean(1).exp()
    return (MIDDLE_GREY / grey)[:, None, None, None]


def _behind(frame: Frame, behind: Frame) -> Tensor:
    """What arrives from behind the first surface."""
    through = frame.gbuffer.transmittance
    return _light(frame, best_picture(behind) * (1.0 if through is None else through))
