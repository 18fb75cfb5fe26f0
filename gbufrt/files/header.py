"""The JSON that a gbufrt EXR file carries in its header: cameras, conventions, and the list of layers."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from gbufrt.camera import Camera
from gbufrt.files.guard import Part

ATTRIBUTE = "gbufrt"
FORMAT = 1
CONVENTIONS = {
    "view space": "OpenCV: x right, y down, z forward",
    "world space": "right-handed, y up",
    "pixel centres": "at +0.5; pixel i was sampled at i + 0.5 + jitter",
    "depth": "planar view-space z in world units; camera far where hit is 0",
    "normal": "world space, unit length, facing the camera",
    "motion": "previous minus current position in pixels, x right, y down, without jitter",
    "light": "outgoing linear radiance, albedo included",
    "ids": "32 bits; signed where the layer's type is int32",
}


def camera_out(camera: Camera) -> dict[str, Any]:
    """The first camera of a batch as JSON values."""
    return {
        "intrinsics": camera.intrinsics[0].tolist(),
        "world_from_view": camera.world_from_view[0].tolist(),
        "size": list(camera.size),
        "near": camera.near,
        "far": camera.far,
        "orthographic": camera.orthographic,
        "jitter": None if camera.jitter is None else camera.jitter[0].tolist(),
        "type": str(camera.intrinsics.dtype).removeprefix("torch."),
    }


def standard_matrices(camera: Camera) -> dict[str, np.ndarray]:
    """OpenEXR's standard attributes ``worldToCamera`` and ``worldToNDC`` of the first camera of a batch.

    Rows times matrix; x right, y up, z back; the whole picture, without jitter, goes from (0, 0) at its upper left to
    (1, 1), and depth from 0 at ``near`` to 1 at ``far``.
    """
    k, (height, width), near, far = camera.intrinsics[0].double().cpu().numpy(), camera.size, camera.near, camera.far
    (across, _, x), (_, down, y) = k[0] / width, k[1] / height
    span = far - near
    if camera.orthographic:
        rows = [[across, 0, 0, x], [0, down, 0, y], [0, 0, 1 / span, -near / span], [0, 0, 0, 1]]
    else:
        rows = [[across, 0, x, 0], [0, down, y, 0], [0, 0, far / span, -far * near / span], [0, 0, 1, 0]]
    view = np.linalg.inv(camera.world_from_view[0].double().cpu().numpy())
    found = {"worldToCamera": np.diag([1.0, -1.0, -1.0, 1.0]) @ view, "worldToNDC": np.array(rows) @ view}
    return {name: np.ascontiguousarray(matrix.T, np.float32) for name, matrix in found.items()}


def camera_in(row: Mapping[str, Any]) -> Camera:
    """The camera that `camera_out` wrote, as a batch of one."""
    dtype = {"float32": torch.float32, "float64": torch.float64}[row["type"]]
    return Camera(
        intrinsics=torch.tensor(row["intrinsics"], dtype=dtype)[None],
        world_from_view=torch.tensor(row["world_from_view"], dtype=dtype)[None],
        size=(int(row["size"][0]), int(row["size"][1])),
        near=float(row["near"]),
        far=float(row["far"]),
        orthographic=bool(row["orthographic"]),
        jitter=None if row["jitter"] is None else torch.tensor(row["jitter"], dtype=dtype)[None],
    )


def read_attribute(path: str | Path, parts: Iterable[Part]) -> dict[str, Any]:
    """The JSON in the header of a file's parts.

    Raises:
        ValueError: there is none, or it is not ours.
    """
    text = next((part.header[ATTRIBUTE] for part in parts if ATTRIBUTE in part.header), None)
    if text is None:
        raise ValueError(
            f"{path} was not written by gbufrt: its header has no {ATTRIBUTE!r} attribute; files of other renderers "
            "are read with `gbufrt post --from auto` and gbufrt.files.read_gbuffer"
        )
    try:
        head = json.loads(text)
    except (ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"{path} is damaged: its {ATTRIBUTE!r} attribute is not JSON") from error
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise ValueError(f"{path} has an unknown format; this gbufrt reads format {FORMAT}")
    return head
