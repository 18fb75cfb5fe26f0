"""Fit constants of post.GTAO to ray-traced ambient occlusion of radius 2 and 4, in the views of a world.

By default how far solids reach on unseen (`hidden`); with `thickness=0.2,0.5,1` what to assume of solids where a
G-buffer does not tell, and with `radius=2,2.2,2.5` how far to look. Prints the error of each choice in every view; the
best is the one whose worst view is best.
"""

from __future__ import annotations

import argparse
from itertools import product

import torch
from torch import Tensor

import tracer
from gbufrt import Frame
from post import GTAO
from tracer.gbuffer import gbuffer
from tracer.truth import ambient_occlusion

RADIUS, SCALES = 2.0, 2
Choice = dict[str, float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("constants", nargs="*", default=["hidden=0,0.1,0.15,0.2,0.3"], metavar="NAME=VALUE,VALUE")
    parser.add_argument("--world", default="valley")
    parser.add_argument("--views", nargs="+", default=["plaza", "hall", "closeup", "cave"])
    parser.add_argument("--size", nargs=2, type=int, default=[135, 240], metavar=("H", "W"))
    parser.add_argument("--samples", type=int, default=128)
    options = parser.parse_args()
    choices = choices_of(options.constants)
    scene = tracer.load(options.world)
    errors = []
    for view in options.views:
        camera = scene.views[view].camera(0.0, size=tuple(options.size))
        frame = Frame(gbuffer=gbuffer(scene, camera, time=0.0))
        truth = true_ao(scene, frame, options.samples)
        errors.append([error(frame, truth, choice) for choice in choices])
        for choice, rmse in zip(choices, errors[-1], strict=True):
            print(f"{view}, {named(choice)}: RMSE {rmse:.4f}", flush=True)
    worst = torch.tensor(errors).amax(0)
    print(f"best: {named(choices[int(worst.argmin())])}, RMSE {float(worst.min()):.4f} in the worst view")


def choices_of(constants: list[str]) -> list[Choice]:
    """All combinations of the values of ``NAME=VALUE,VALUE``."""
    values = {name: [float(v) for v in several.split(",")] for name, _, several in (c.partition("=") for c in constants)}
    return [dict(zip(values, combination, strict=True)) for combination in product(*values.values())]


def named(choice: Choice) -> str:
    return ", ".join(f"{name}={value:g}" for name, value in choice.items())


def true_ao(scene: tracer.Scene, frame: Frame, samples: int) -> Tensor:
    """The mean over the radii, as GTAO's scales have it."""
    shots = [
        ambient_occlusion(scene, frame.gbuffer, poses=scene.poses([0.0]), radius=RADIUS * 2**scale, samples=samples)
        for scale in range(SCALES)
    ]
    return torch.stack([shot.values["ao"] for shot in shots]).mean(0)


def error(frame: Frame, truth: Tensor, choice: Choice) -> float:
    stage = GTAO(**{"radius": RADIUS, "directions": 8, "steps": 16, "scales": SCALES, **choice})  # pyright: ignore
    if "thickness" in choice:  # assumed, not measured
        frame = frame.replace(gbuffer=frame.gbuffer.replace(thickness=None))
    ao = torch.stack([stage(frame.replace(index=i)).read("ao") for i in range(2)]).mean(0)
    return float((ao - truth)[frame.gbuffer.hit].square().mean().sqrt())


if __name__ == "__main__":
    main()
