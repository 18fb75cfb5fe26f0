"""Temporal upscaling leaves no grid of the pixels that samples lay near to."""

from __future__ import annotations

import boxes
import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Frame
from gbufrt.noise.noise import halton_jitter
from gbufrt.sampling import pixel_centers
from post import Upscale
from post.passes.lens.upscale import mirrored_share

SIZE = (24, 32)
STILL, STEP = 16, 0.3  # frames before the camera moves, and by how much it does
BOX = torch.tensor([[[0.0, 1.0, 2.0], [2.0, 3.0, 3.0]]])


def mirror(index: int) -> Frame:
    """A smooth surface that stands still, and shows waves that do not."""
    still = boxes.frame(boxes.camera(SIZE).with_jitter(halton_jitter(index, length=32)), previous=boxes.camera(SIZE))
    place = pixel_centers(still.gbuffer.depth)
    light = 1 + 0.9 * torch.sin(place[:, :1] * 0.4 + 0.9 * index) * torch.sin(place[:, 1:] * 0.5 - 0.7 * index)
    light = light.expand(-1, 3, -1, -1)
    smooth = still.gbuffer.replace(roughness=torch.full_like(still.gbuffer.depth, 0.05))
    return still.replace(gbuffer=smooth, color=light, reflection=light)


def dots(color: Tensor) -> float:
    """How far pixels differ from the mean of the 3x3 around."""
    around = F.avg_pool2d(F.pad(color, (1, 1, 1, 1), mode="replicate"), 3, stride=1)
    return float((color - around).square().mean().sqrt())


def last(stage: Upscale, frames: list[Frame]) -> Tensor:
    state, color = None, torch.zeros(())
    for frame in frames:
        after, state = stage(frame, state)
        color = after.read("color")
    return color


def test_what_mirrors_show_changes_all_pixels_alike():
    frames = [mirror(index) for index in range(12)]
    rough = [frame.replace(reflection=None) for frame in frames]
    stage = Upscale(reactivity=0.0)
    assert dots(last(stage, frames)) < 0.75 * dots(last(stage, rough))


def test_first_frames_count_alike_where_their_light_differs():
    """As it does until a denoiser has seen some. Pixels that a sample lies near to would else keep the light of its
    frame, and their neighbours take that of the next: 0.21 at the second frame, 0.18 at the third."""
    frames = [mirror(index).replace(reflection=None) for index in range(3)]
    for count, most in ((2, 0.12), (3, 0.14)):
        assert dots(last(Upscale(reactivity=0.0), frames[:count])) < most


def test_only_smooth_surfaces_mirror():
    frame = mirror(0)
    share = mirrored_share(frame)
    assert share is not None
    assert float(share[frame.gbuffer.hit].min()) > 0.8
    matt = frame.gbuffer.replace(roughness=torch.ones_like(frame.gbuffer.depth))
    assert not bool(torch.as_tensor(mirrored_share(frame.replace(gbuffer=matt))).any())
    assert mirrored_share(frame.replace(reflection=None)) is None


def test_what_comes_into_view_shows_no_outline_of_what_hid_it():
    """A camera that passes a dark box before a bright wall: what the box uncovers is bright at once."""

    def seen(index: int, size: tuple[int, int], jitter: tuple[float, float] | None) -> Frame:
        dx = STEP * max(index - STILL, 0)
        before = boxes.camera(size, dx=STEP * max(index - 1 - STILL, 0))
        room = torch.cat([boxes.ROOM[:2], BOX])
        frame = boxes.frame(boxes.camera(size, dx=dx).with_jitter(jitter), previous=before, boxes=room)
        dark = frame.read("albedo")[:, :1] == boxes.ALBEDO[2, 0]
        return frame.replace(color=torch.where(dark, 0.02, 1.0).expand(-1, 3, -1, -1))

    large = SIZE[0] * 2, SIZE[1] * 2
    frames = [seen(index, SIZE, halton_jitter(index, length=32)) for index in range(STILL + 3)]
    shown, truth = last(Upscale(reactivity=0.0), frames), seen(STILL + 2, large, None).read("color")
    box = F.max_pool2d((truth < 1).float(), 3, 1, 1) > 0
    assert float(shown[~box].min()) > 0.9
