"""Fit how far solids reach on unseen (`hidden` of post.GTAO) to ray-traced ambient occlusion, in the views of a world.

Prints the error of each candidate in every view; the best is the one whose worst view is best.
"""

from __future__ import annotations

import argparse

import torch
from torch import Tensor

import tracer
from gbufrt import Frame
from post import GTAO
from tracer.gbuffer import gbuffer
from tracer.truth import ambient_occlusion

RADIUS, SCALES = 2.0, 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", default="valley")
    parser.add_argument("--views", nargs="+", default=["plaza", "hall", "closeup", "cave"])
    parser.add_argument("--hidden", nargs="+", type=float, default=[0.0, 0.1, 0.15, 0.2, 0.3])
    parser.add_argument("--size", nargs=2, type=int, default=[135, 240], metavar=("H", "W"))
    parser.add_argument("--samples", type=int, default=128)
    options = parser.parse_args()
    scene = tracer.load(options.world)
    errors = []
    for view in options.views:
        camera = scene.views[view].camera(0.0, size=tuple(options.size))
        frame = Frame(gbuffer=gbuffer(scene, camera, time=0.0))
        truth = true_ao(scene, frame, options.samples)
        errors.append([error(frame, truth, hidden) for hidden in options.hidden])
        print(view, *(f"{hidden:g}: {rmse:.4f}" for hidden, rmse in zip(options.hidden, errors[-1], strict=True)))
    worst = torch.tensor(errors).amax(0)
    print(f"best: hidden = {options.hidden[int(worst.argmin())]:g}, RMSE {float(worst.min()):.4f} in the worst view")


def true_ao(scene: tracer.Scene, frame: Frame, samples: int) -> Tensor:
    """The mean over the radii, as GTAO's scales have it."""
    shots = [
        ambient_occlusion(scene, frame.gbuffer, poses=scene.poses([0.0]), radius=RADIUS * 2**scale, samples=samples)
        for scale in range(SCALES)
    ]
    return torch.stack([shot.values["ao"] for shot in shots]).mean(0)


def error(frame: Frame, truth: Tensor, hidden: float) -> float:
    stage = GTAO(radius=RADIUS, directions=8, steps=16, scales=SCALES, hidden=hidden)
    ao = torch.stack([stage(frame.replace(index=i)).read("ao") for i in range(2)]).mean(0)
    return float((ao - truth)[frame.gbuffer.hit].square().mean().sqrt())


if __name__ == "__main__":
    main()
