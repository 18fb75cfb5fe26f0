"""Frame: a G-buffer, the light that reached it, and the signals that passes have written."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor

from gbufrt.channels import channel, channels_of, check_extra, check_layer, check_one_kind, check_tensor
from gbufrt.gbuffer import CHANNELS, GBuffer, to_function
from gbufrt.names import meant
from gbufrt.numeric import check_flags, check_index, check_kind, check_numbers
from gbufrt.tree import changed, map_tensors, without_graph
from gbufrt.validation.checks import validate_gbuffer, validate_signals


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """What passes read and write. All light is outgoing linear radiance with albedo included.

    Raises:
        TypeError: a field is not a tensor, of the wrong type, or of another kind of floats than the G-buffer.
        ValueError: a field has the wrong shape or device, or an extra signal takes the name of a known one.
    """

    gbuffer: GBuffer
    index: int | Tensor = 0
    """Frame number: with ``seed``, the only source of noise. A 0-dim integer tensor on the device of the rest is read
    by no host, so that a CUDA graph captured with it makes new noise whenever it holds another number."""
    time: float | Tensor = 0.0
    """Seconds; like the index, it may lie on the device, as a 0-dim tensor of doubles."""
    cut: Tensor | None = None
    """``(B,)`` bool: the camera jumped, so nothing of the frame before may be used."""
    steady: bool = False
    """Whether nothing has moved or changed since the frame before, see `still`: what differs is noise."""
    emitters_sampled: bool = True
    """Whether ``radiance`` already includes direct light from emitters, so that GI must not gather emission again."""
    emitters_mirrored: bool = False
    """Whether ``radiance`` already shows emitters in mirrors, so that reflections must not show emission again."""
    behind: Frame | None = None
    """What lies straight behind the first transmissive surface, without refraction; never part of ``radiance``."""
    previous: Frame | None = None
    """The frame before, filled by the outermost pipeline; its own ``previous`` is None."""
    extra: Mapping[str, Tensor] = field(default_factory=dict)
    """Signals that gbufrt has no field for, by name; reach them with `read` and `write`."""

    radiance: Tensor | None = channel(3, "direct light and emission, outgoing linear radiance")
    ambient: Tensor | None = channel(3, "sky light as if nothing blocked it, outgoing linear radiance")
    environment: Tensor | None = channel(3, "lat-long sky radiance, linear", full_size=False)
    fog_transmittance: Tensor | None = channel(1, "share of light that fog before the surface or sky lets through")
    fog_light: Tensor | None = channel(
        3, "mean radiance that fog there scatters over the share it takes, or of every second pixel", full_size=False
    )
    fog_mirrored: Tensor | None = channel(4, "the same on the mirrored ray, and its transmittance", full_size=False)

    diffuse: Tensor | None = channel(3, "diffuse light by one sample a pixel, albedo divided out, linear radiance")
    indirect: Tensor | None = channel(3, "the part of `diffuse` that surfaces and the sky send, albedo divided out")
    specular: Tensor | None = channel(3, "specular light by one sample a pixel, Fresnel included, linear radiance")
    shadow: Tensor | None = channel(2, "share of light along a shadow ray to the sun and one to a lamp, 1 lit")
    replayed: Tensor | None = channel(1, "1 at pixels of the frame before whose samples were taken again, else 0")
    replayed_diffuse: Tensor | None = channel(3, "their `diffuse` in the scene as it is now")
    replayed_specular: Tensor | None = channel(3, "their `specular` in the scene as it is now")
    cached_diffuse: Tensor | None = channel(3, "`diffuse` with the `indirect` light that a cache knows")

    ao: Tensor | None = channel(1, "ambient visibility, 1 open", clear=1.0)
    sky_visibility: Tensor | None = channel(1, "visibility of the sky at unlimited radius, 1 open", clear=1.0)
    bent_normal: Tensor | None = channel(3, "mean unoccluded direction, world space, unit length")
    gi: Tensor | None = channel(3, "indirect diffuse, outgoing linear radiance")
    reflection: Tensor | None = channel(3, "specular light, Fresnel included, linear radiance")
    reflection_confidence: Tensor | None = channel(1, "share of the reflection found on screen, 0 to 1")
    reflection_distance: Tensor | None = channel(1, "distance from the surface to what it mirrors, world units")
    fog: Tensor | None = channel(3, "light that fog adds before the surface or sky, linear radiance")
    fog_reflection: Tensor | None = channel(4, "light that fog adds along the mirrored ray, and its transmittance")
    composite: Tensor | None = channel(3, "all light together, linear radiance")
    color: Tensor | None = channel(3, "the composite after lens and anti-aliasing passes, linear radiance", larger=True)
    exposure: Tensor | None = channel(1, "factor on colour before the tone curve, (B,1,1,1)", full_size=False)
    image: Tensor | None = channel(3, "display-referred picture in [0, 1]", larger=True)

    def __post_init__(self) -> None:
        self._check(SIGNALS)

    def _check(self, names: Iterable[str]) -> None:
        """Raise if one of the signals called ``names``, ``extra`` or ``cut`` breaks its form."""
        check_kind(GBuffer, "gbuffer", self.gbuffer)
        camera = self.gbuffer.camera
        for name in names:
            if (tensor := getattr(self, name)) is not None:
                check_tensor(name, tensor, SIGNALS[name], batch=camera.batch, size=camera.size, device=camera.device)
                check_one_kind(**{"depth": self.gbuffer.depth, name: tensor})
        check_extra(self.extra, (SIGNALS, CHANNELS))
        check_layer(Frame, "behind", self.behind, camera)
        check_layer(Frame, "previous", self.previous)
        check_index(self.index)
        check_numbers(time=self.time)
        check_flags(**{name: getattr(self, name) for name in ("steady", "emitters_sampled", "emitters_mirrored")})
        if not isinstance(self.cut, Tensor | None):
            raise TypeError(f"cut must be a ({camera.batch},) bool tensor or None, got {type(self.cut).__name__}")
        if self.cut is not None and (self.cut.shape != (camera.batch,) or self.cut.dtype != torch.bool):
            raise ValueError(f"cut must be ({camera.batch},) bool, got {tuple(self.cut.shape)} {self.cut.dtype}")

    def __repr__(self) -> str:
        """In ten lines at most: camera, and names of what there is, with sizes where these are not the picture's."""
        g, signals = self.gbuffer, [name for name in SIGNALS if getattr(self, name) is not None]
        absent = [name for name in CHANNELS if getattr(g, name) is None]
        absent += [name for name in LIGHT if name not in signals]
        rows = {
            "camera": repr(g.camera),
            "before": "" if g.previous_camera is None else repr(g.previous_camera),
            "gbuffer": self._listed(g.present),
            "light": self._listed(name for name in signals if name in LIGHT),
            "signals": self._listed(name for name in signals if name not in LIGHT),
            "extra": self._listed(self.extra),
            "absent": ", ".join(absent),
            "behind": "" if self.behind is None else self.behind._listed(self.behind.present),
        }
        b, _, h, w = g.depth.shape
        kind = str(g.depth.dtype).removeprefix("torch.")
        cut = "" if self.cut is None else f", cut {self.cut.tolist()}"
        head = f"Frame {int(self.index)} at {float(self.time):g} s: batch {b}, {w}x{h}, {kind} on {g.depth.device}{cut}"
        return "\n".join([head, *(f"  {name:8s} {text}" for name, text in rows.items() if text)])

    def _listed(self, names: Iterable[str]) -> str:
        """Names with their numbers of components, and their sizes where these are not the picture's."""
        told = []
        for name in names:
            if (tensor := self.read(name)).ndim != 4:
                told.append(f"{name} {tuple(tensor.shape)}")
                continue
            _, c, h, w = tensor.shape
            size = [] if (h, w) == self.gbuffer.camera.size else [f"{w}x{h}"]
            told.append(f"{name} ({', '.join([str(c), *size])})" if c > 1 or size else name)
        return ", ".join(told)

    def replace(self, **changes: Any) -> Frame:
        """A copy with some fields changed."""
        result = changed(self, changes)
        result._check(SIGNALS if "gbuffer" in changes else changes.keys() & SIGNALS.keys())
        return result

    def to(self, *args: Any, **kwargs: Any) -> Frame:
        """All tensors on another device; arguments as `torch.Tensor.to`."""
        return map_tensors(to_function(*args, **kwargs), self)

    def detach(self) -> Frame:
        """The same numbers without their gradients."""
        return map_tensors(without_graph, self)

    def get(self, name: str) -> Tensor | None:
        """The signal, light or channel called ``name``, or None where it is absent."""
        if name in SIGNALS:
            return getattr(self, name)
        return getattr(self.gbuffer, name) if name in CHANNELS else self.extra.get(name)

    def read(self, name: str) -> Tensor:
        """The signal, light or channel called ``name``.

        Raises:
            ValueError: it is absent; the message lists what is there.
        """
        if (tensor := self.get(name)) is None:
            raise ValueError(f"the frame has no {name!r}{meant(name, self.present)}; it has {', '.join(self.present)}")
        return tensor

    def write(self, name: str, tensor: Tensor) -> Frame:
        """A copy with the signal ``name`` set: a known one in its field, any other among ``extra``.

        Raises:
            ValueError: the name is a G-buffer channel, which passes do not write.
        """
        if name in CHANNELS:
            raise ValueError(f"{name!r} is a G-buffer channel; use frame.replace(gbuffer=frame.gbuffer.replace(...))")
        if name in SIGNALS:
            return self.replace(**{name: tensor})
        return self.replace(extra={**self.extra, name: tensor})

    def only(self, names: Collection[str]) -> Frame:
        """The frame with these channels, light and signals alone, and what every G-buffer has.

        What lies `behind` stays if ``names`` holds ``"behind"``; it and `previous` lose the rest too.
        """
        names, g = (names,) if isinstance(names, str) else names, self.gbuffer
        channels = {name: None for name in g.present if not (CHANNELS[name].required or name in names)}
        signals = {name: None for name in SIGNALS if name not in names}
        layers = {"previous": self.previous, "behind": self.behind if "behind" in names else None}
        kept = {name: None if layer is None else layer.only(names) for name, layer in layers.items()}
        extra = {name: tensor for name, tensor in self.extra.items() if name in names}
        return self.replace(gbuffer=g.replace(**channels), extra=extra, **signals, **kept)

    @property
    def present(self) -> tuple[str, ...]:
        """Names of all channels, light and signals that are present."""
        signals = tuple(name for name in SIGNALS if getattr(self, name) is not None)
        return self.gbuffer.present + signals + tuple(self.extra)

    def validate(self, before: Frame | None = None) -> None:
        """Check G-buffer, light and signals against the conventions, and the same of what lies `behind`.

        Args:
            before: the frame before, to check the motion of what moves by itself; see `GBuffer.validate`.

        Raises:
            ValueError: names the first channel that breaks a rule, the rule, how many pixels break it, one of them,
                and a remedy.
        """
        check_kind(Frame, "before", self if before is None else before)
        layer, prefix = self, ""
        while layer is not None:
            validate_gbuffer(layer.gbuffer, None if before is None or prefix else before.gbuffer, prefix)
            signals = {name: tensor for name in SIGNALS if (tensor := getattr(layer, name)) is not None}
            validate_signals({**signals, **layer.extra}, layer.gbuffer.hit, prefix)
            layer, prefix = layer.behind, f"{prefix}behind."

    def still(self) -> Frame:
        """The frame as if nothing had moved or changed before it, and the same of what lies `behind`."""
        g = self.gbuffer
        none = {name: torch.zeros_like(g_name) for name in MOTION if (g_name := getattr(g, name)) is not None}
        behind = None if self.behind is None else self.behind.still()
        gone = dict.fromkeys(("cut", *REPLAYED))  # samples at the pixels of a camera that stood elsewhere
        return self.replace(gbuffer=g.replace(previous_camera=g.camera, **none), steady=True, behind=behind, **gone)

    def moving_as(self, frame: Frame) -> Frame:
        """This frame with motion, cut and replayed samples of another one, `behind` likewise: undoes `still`."""
        check_kind(Frame, "frame", frame)
        g, behind = frame.gbuffer, self.behind
        motion = {name: tensor for name in MOTION if (tensor := getattr(g, name)) is not None}
        if behind is not None and frame.behind is not None:
            behind = behind.moving_as(frame.behind)
        moving = self.gbuffer.replace(previous_camera=g.previous_camera, **motion)
        replayed = {name: getattr(frame, name) for name in REPLAYED}
        return self.replace(gbuffer=moving, cut=frame.cut, steady=frame.steady, behind=behind, **replayed)

    def as_previous(self, names: Iterable[str] = ("radiance", "ambient", "gi", "sky_visibility", "composite")) -> Frame:
        """What the next frame may read of this one: geometry and the signals called ``names``."""
        names = (names,) if isinstance(names, str) else tuple(names)
        keep = {name: getattr(self, name) for name in names if name in SIGNALS}
        extra = {name: self.extra[name] for name in names if name in self.extra}
        return Frame(gbuffer=self.gbuffer.geometry(), index=self.index, time=self.time, extra=extra, **keep)


SIGNALS = channels_of(Frame)
MOTION = ("motion", "motion_z")
REPLAYED = ("replayed", "replayed_diffuse", "replayed_specular")
LIGHT = (
    *("radiance", "ambient", "environment", "fog_transmittance", "fog_light", "fog_mirrored"),
    *("diffuse", "indirect", "specular", "shadow", *REPLAYED, "cached_diffuse"),
)
"""Signals that come with the frame rather than from a pass."""
