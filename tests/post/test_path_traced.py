"""The frame of Minecraft RTX: a small noisy frame, and a large clean picture."""

from __future__ import annotations

from pathlib import Path

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Frame
from gbufrt.files.exr import read_exr, write_exr
from gbufrt.noise.noise import halton_jitter
from post import DepthOfField, Enlarged, MotionBlur, minecraft_rtx, with_fog
from post.path_traced import QUALITIES
from post.shading.composite_op import specular_albedo
from post.upsampling.enlarged import enlarged

SIZE = (18, 24)


def frames(count: int) -> list[Frame]:
    """From a camera that moves, each with noise of its own."""
    made, previous = [], None
    for index in range(count):
        camera = boxes.camera(SIZE, dx=0.05 * index).with_jitter(halton_jitter(index, length=32))
        frame = boxes.frame(camera, previous=previous, index=index).replace(ambient=None)
        noise = torch.rand(frame.gbuffer.depth.shape, generator=torch.Generator().manual_seed(index))
        light = frame.read("radiance") * 2 * noise
        chosen, again = torch.zeros_like(noise), (light if not made else made[-1].read("diffuse"))
        chosen[..., 1::3, 1::3] = 1.0
        apart = {"diffuse": light, "specular": 0.1 * light, "replayed": chosen if made else None}
        apart |= {"replayed_diffuse": again, "replayed_specular": 0.1 * again} if made else {}
        made.append(frame.replace(radiance=light, **apart))
        previous = camera
    return made


@pytest.mark.parametrize("preset", QUALITIES)
def test_pictures_are_as_large_as_the_preset_says(preset):
    ratio = QUALITIES[preset].ratio
    (frame,) = frames(1)
    result, _ = minecraft_rtx(preset)(frame)
    for name in ("color", "image"):
        assert result.read(name).shape[2:] == (round(18 * ratio), round(24 * ratio))
    assert result.read("composite").shape[2:] == SIZE
    assert result.gbuffer is frame.gbuffer, "what was traced stays"
    assert result.radiance is frame.radiance
    assert result.diffuse is frame.diffuse
    assert 0 <= float(result.read("image").min()) < float(result.read("image").max()) <= 1


def test_lens_and_overlay_work_at_the_size_of_the_display():
    pipeline = minecraft_rtx("high")
    for name, stage in (("motion_blur", MotionBlur()), ("depth_of_field", DepthOfField())):
        pipeline = pipeline.with_stage(f"display.{name}", stage, before="exposure")
    ui = torch.zeros(1, 4, 36, 48)
    ui[:, :, 2:4, 3:5] = 1.0
    result = frames(1)[0]
    for result in pipeline.stream(frame.write("ui", ui) for frame in frames(3)):
        assert torch.isfinite(result.read("color")).all()
    assert bool((result.read("image")[..., 2:4, 3:5] == 1).all()), "no lens touches the interface"


def test_without_the_upscaler_all_has_one_size():
    result, _ = minecraft_rtx("high").without("upscale")(frames(1)[0])
    assert result.read("image").shape[2:] == SIZE


def test_the_enlarged_frame_shows_the_same_view():
    g = frames(2)[1].gbuffer
    large = enlarged(g, (36, 48))
    assert large.camera.jitter is None
    large.validate()
    assert large.previous_camera is not None
    assert large.motion is not None
    still = large.camera.static_motion(large.previous_camera, large.depth, large.hit)[0]
    assert float((still - large.motion).abs()[large.hit.expand(-1, 2, -1, -1)].median()) < 0.02
    same = frames(1)[0]
    assert Enlarged().reduce(same.replace(color=same.radiance)).gbuffer is same.gbuffer


@pytest.mark.parametrize("compression", ["zip", "dwaa"])
def test_files_hold_a_picture_larger_than_the_g_buffer(tmp_path: Path, compression):
    result, _ = minecraft_rtx("high")(frames(1)[0])
    write_exr(tmp_path / "frame.exr", result, compression=compression)
    back = read_exr(tmp_path / "frame.exr")
    assert torch.equal(back.gbuffer.depth, result.gbuffer.depth)
    assert torch.equal(back.read("radiance"), result.read("radiance"))
    assert back.read("image").shape == result.read("image").shape
    if compression == "zip":
        assert torch.equal(back.read("color"), result.read("color"))


def test_smaller_pictures_than_the_g_buffer_are_refused():
    with pytest.raises(ValueError, match="color must be"):
        frames(1)[0].replace(color=torch.zeros(1, 3, 9, 24))


def test_fog_goes_before_the_composite():
    names = [name for name, _ in with_fog(minecraft_rtx("low", denoiser="denoise")).passes()]
    assert names[1:4] == ["light.fog", "light.fog_behind.fog", "light.composite"]


def test_all_light_in_one_is_denoised_likewise():
    (frame,) = frames(1)
    whole = frame.replace(diffuse=None, specular=None)
    result, _ = minecraft_rtx("high", denoiser="denoise")(whole)
    assert result.read("radiance_history").shape[2:] == SIZE
    with pytest.raises(ValueError, match="'diffuse', which the frame lacks"):
        minecraft_rtx("high")(whole)


def test_light_adds_up_in_both_layers():
    pipeline = minecraft_rtx("low").without("light.diffuse", "light.specular", "upscale", "display")
    pipeline = pipeline.without("light.behind.diffuse", "light.behind.specular")
    (far,) = frames(1)
    clear = torch.full_like(far.read("diffuse"), 0.25)
    frame = far.replace(gbuffer=far.gbuffer.replace(transmittance=clear), ambient=clear)
    g, hit = frame.gbuffer, frame.gbuffer.hit
    result, _ = pipeline(frame.replace(behind=far))

    def light(through: Tensor | float) -> Tensor:
        own = far.read("albedo") * far.read("diffuse") + through
        return own * (1 - specular_albedo(g)) + far.read("specular")

    want = light(0.25 * light(0.0))
    torch.testing.assert_close(result.read("composite").where(hit, 0), want.where(hit, 0))


def test_mistakes_are_told():
    with pytest.raises(ValueError, match=r"'hihg' \(did you mean high\?\)"):
        minecraft_rtx("hihg")
    with pytest.raises(ValueError, match="denoiser must be one of asvgf, denoise"):
        minecraft_rtx(denoiser="svgf")  # pyright: ignore[reportArgumentType]
    assert minecraft_rtx("low", tunables={"upscale.sharpness": 0.5}).all_tunables()["upscale.sharpness"] == 0.5
