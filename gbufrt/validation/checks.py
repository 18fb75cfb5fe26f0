"""What is checked, channel by channel; see the other files of this room for each."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from gbufrt.camera.matrices import check_matrices
from gbufrt.tree import map_tensors, without_graph
from gbufrt.validation.geometry import Geometry, check_depth, check_normal, check_planar
from gbufrt.validation.ids import check_ids
from gbufrt.validation.motion import check_motion, check_movers, check_previous
from gbufrt.validation.pixels import check_finite, check_not_negative, check_range, check_unit

UNIT_RANGE = ("albedo", "roughness", "metallic", "opacity", "transmittance")
SHARES = ("ao", "sky_visibility", "reflection_confidence", "shadow", "replayed")
LIGHTS = (
    *("radiance", "ambient", "environment", "fog_light", "fog", "gi", "reflection", "composite", "color"),
    *("diffuse", "indirect", "specular", "replayed_diffuse", "replayed_specular", "cached_diffuse"),
)


def validate_gbuffer(g: Geometry, before: Geometry | None = None, prefix: str = "") -> None:
    """See `gbufrt.GBuffer.validate`; ``prefix`` goes before the names of channels in messages."""
    g, before = map_tensors(without_graph, (g, before))  # checks read numbers
    for camera in (g.camera, g.previous_camera):
        if camera is not None:
            check_matrices(camera.intrinsics, camera.world_from_view, camera.jitter)
    channels: dict[str, Tensor] = {name: getattr(g, name) for name in g.present}
    for name, tensor in channels.items():
        remedy = "; write the camera's far and hit = False where nothing was hit" if name == "depth" else ""
        check_finite(prefix + name, tensor, remedy)
    check_depth(g, prefix)
    for name in ("normal", "normal_geo"):
        if name in channels:
            check_normal(g, prefix + name, channels[name])
    check_planar(g, prefix)
    for name in UNIT_RANGE:
        if name in channels:
            check_range(prefix + name, channels[name])
    for name in ("emission", "thickness"):
        if name in channels:
            check_not_negative(prefix + name, channels[name])
    if "object_id" in channels:
        check_ids(g, channels["object_id"], prefix)
    if g.motion is not None and g.previous_camera is not None:
        check_motion(g, g.motion, prefix)
    if before is not None and g.previous_camera is not None:
        check_previous(g.previous_camera, before.camera, prefix)
    if g.motion is not None and before is not None:
        check_movers(g, g.motion, before, prefix)


def validate_signals(signals: Mapping[str, Tensor], hit: Tensor, prefix: str = "") -> None:
    """See `gbufrt.Frame.validate`.

    Args:
        signals: light and signals by name.
        hit: ``(B, 1, H, W)`` bool.
        prefix: goes before the names in messages.

    Raises:
        ValueError: names the first signal that breaks a rule.
    """
    for name, tensor in signals.items():
        remedy = "; gbufrt.mending.mended mends light" if name in LIGHTS else ""
        check_finite(prefix + name, tensor, remedy)
        if name in LIGHTS:
            check_not_negative(prefix + name, tensor)
        if name in (*SHARES, "image"):
            check_range(prefix + name, tensor)
        if name == "bent_normal":
            check_unit(prefix + name, tensor, hit)
