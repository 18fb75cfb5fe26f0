"""Fit constants of post.GTAO to ray-traced ambient occlusion, in the views of a world: the best worst view wins.

By default it fits `hidden`, how far solids extend behind their measured backs. `thickness=0.2,0.5,1` fits the thickness
assumed where a G-buffer has none; `radius=2,2.2` fits the radius that best matches truth within 2.
"""

import argparse
from itertools import product

import torch
from torch import Tensor

import tracer
from gbufrt import Frame
from post import GTAO
from tracer.gbuffers import gbuffer
from tracer.truth.truth import ambient_occlusion

RADIUS, SCALES = 2.0, 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("constants", nargs="*", default=["hidden=0,0.1,0.15,0.2,0.3"], metavar="NAME=VALUE,VALUE")
    parser.add_argument("--world", default="valley")
    parser.add_argument("--views", nargs="+", default=["plaza", "hall", "closeup", "cave"])
    parser.add_argument("--size", nargs=2, type=int, default=[135, 240], metavar=("H", "W"))
    parser.add_argument("--samples", type=int, default=128)
    options = parser.parse_args()
    tried = {name: values.split(",") for name, _, values in (given.partition("=") for given in options.constants)}
    choices = [dict(zip(tried, map(float, values), strict=True)) for values in product(*tried.values())]
    scene, worst = tracer.load(options.world), torch.zeros(len(choices))
    for view in options.views:
        camera = scene.views[view].camera(0.0, size=tuple(options.size))
        frame = Frame(gbuffer=gbuffer(scene, camera, time=0.0))
        truth = true_ao(scene, frame, options.samples)
        errors = torch.tensor([error(frame, truth, choice) for choice in choices])
        for choice, rmse in zip(choices, errors, strict=True):
            print(view, choice, f"RMSE {float(rmse):.4f}", flush=True)
        worst = torch.maximum(worst, errors)
    print("best:", choices[int(worst.argmin())], f"RMSE {float(worst.min()):.4f} in the worst view")


def true_ao(scene: tracer.Scene, frame: Frame, samples: int) -> Tensor:
    """The mean over the radii of GTAO's scales."""
    given = {"poses": scene.poses([0.0]), "samples": samples}
    radii = [RADIUS * 2**scale for scale in range(SCALES)]
    return torch.stack([ambient_occlusion(scene, frame.gbuffer, radius=r, **given)["ao"] for r in radii]).mean(0)


def error(frame: Frame, truth: Tensor, choice: dict[str, float]) -> float:
    stage = GTAO(radius=RADIUS, directions=8, steps=16, scales=SCALES).tuned(**choice)
    if "thickness" in choice:  # assumed, not measured
        frame = frame.replace(gbuffer=frame.gbuffer.replace(thickness=None))
    ao = torch.stack([stage(frame.replace(index=i)).read("ao") for i in range(2)]).mean(0)
    return float((ao - truth)[frame.gbuffer.hit].square().mean().sqrt())


if __name__ == "__main__":
    main()
