"""One scene in the conventions of each renderer becomes one frame; each convention broken is told by its setting."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from writers.foreign_exr import BEFORE, CAMERA, FAR, NEAR, SIZE, truth, write, write_parts

from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.files.gbuffers.detect import detect
from gbufrt.files.gbuffers.profile import SHIPPED, load_profile

T = truth()
X, Y, Z = (T["normal"][..., i] for i in range(3))
SKY = ~T["hit"]
Z_UP = np.stack([X, -Z, Y], -1)
UV = T["motion"] / (SIZE[1], SIZE[0])
GREY = np.full((*SIZE, 3), 0.5)
VIEW = (T["normal"] @ CAMERA.world_from_view[0, :3, :3].double().numpy()) * (1, -1, -1)  # y up, z to the viewer
FILES = {
    "blender": {
        "A.v.Depth.Z": np.where(SKY, 1e10, T["planar"]),
        "A.v.Normal.XYZ": Z_UP,
        "A.v.Vector.XY": T["motion"] * (1, -1),
        "A.v.DiffCol.RGB": GREY,
    },
    "mitsuba": {"far.T": np.where(SKY, 0, T["ray"]), "nn.XYZ": Z_UP, "alb.RGB": GREY},
    "falcor": {"linearZ.R": np.where(SKY, 0, T["planar"]), "normW.RGB": T["normal"], "mvec.RG": UV},
    "unreal": {
        "QueueWorldDepth.R": np.where(SKY, 65504, 100 * T["planar"]),
        "QueueWorldNormal.RGB": np.stack([X, Z, Y], -1) / 2 + 0.5,
        "QueueMotionVectors.RG": UV * (-0.5, 0.5) + 0.5,
    },
    "houdini": {"Pz.Z": np.where(SKY, 1e30, T["planar"]), "N.XYZ": T["normal"], "P.XYZ": T["normal"], "C.RGB": GREY},
    "arnold": {"Z": np.where(SKY, 1e30, T["planar"]), "N.XYZ": T["normal"], "diffuse_albedo.RGB": GREY, "RGB": GREY},
    "renderman": {"z": np.where(SKY, 1e10, T["ray"]), "Nn.XYZ": VIEW, "directDiffuse.RGB": GREY, "RGB": GREY},
    "generic": {"VRayZDepth.R": np.where(SKY, 1e10, T["planar"]), "VRayNormals.RGB": VIEW, "RGB": GREY},
    "nuke": {
        "depth.Z": np.where(SKY, 0, 1 / np.where(SKY, 1, T["planar"])),
        "N.XYZ": T["normal"],
        "backward.uv": T["motion"] * (1, -1),
    },
}


@pytest.mark.parametrize("name", FILES)
def test_each_renderer_gives_the_same_frame(name: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", FILES[name])
    assert detect(path).name == name
    frame = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE, index=7)
    frame.validate()
    g = frame.gbuffer
    assert frame.index == 7
    assert bool((g.hit[0, 0].numpy() == T["hit"]).all())
    assert g.motion is not None
    for found, true in ((g.depth, T["planar"][..., None]), (g.normal, T["normal"]), (g.motion, T["motion"])):
        off = np.abs(found[0].permute(1, 2, 0).numpy() - true)[T["hit"]]
        assert off.max() < 2e-3, (name, off.max())
    assert disagreements(frame) == []


@pytest.mark.parametrize("name", SHIPPED)
def test_lamps_in_direct_light_are_emission(name: str) -> None:
    """Else what they have lit already is lit again by GI."""
    profile = load_profile(name)
    lamps = {layer for layer in profile.emitted if "emi" in layer.lower()}
    assert lamps <= {*profile.channels.get("emission", ())}


OWN = {"depth": ["d.Z"], "normal": ["n"], "motion": ["m"], "albedo": ["a"]}
PLAIN = {"d.Z": np.where(SKY, 0, T["planar"]), "n.XYZ": T["normal"], "m.XY": T["motion"], "a.RGB": GREY}


def _own(folder: Path, **settings: object) -> Path:
    lines = [f"{k} = {str(v).lower() if isinstance(v, bool) else repr(v)}" for k, v in settings.items()]
    path = folder / "own.toml"
    path.write_text("\n".join([*lines, "[channels]", *(f"{k} = {v}" for k, v in OWN.items())]))
    return path


def _view(flip: bool) -> np.ndarray:
    rotation = CAMERA.world_from_view[0, :3, :3].double().numpy()
    return (T["normal"] @ rotation) * ((1, -1, -1) if flip else (1, 1, 1))


DEVICE = (1 / T["planar"] - 1 / FAR) / (1 / NEAR - 1 / FAR)
SETTINGS = {
    "ray": ({"depth_kind": "ray"}, {"d.Z": np.where(SKY, 0, T["ray"])}, 'depth_kind = "ray"'),
    "reciprocal": ({"depth_kind": "reciprocal"}, {"d.Z": np.where(SKY, 0, 1 / T["planar"])}, '"reciprocal" or'),
    "reversed": (
        {"depth_kind": "device", "near": NEAR, "far": FAR, "reversed": True},
        {"d.Z": np.where(SKY, 0, DEVICE)},
        '"reciprocal" or "device"',
    ),
    "device": (
        {"depth_kind": "device", "near": NEAR, "far": FAR},
        {"d.Z": np.where(SKY, 1, 1 - DEVICE)},
        None,
    ),
    "down": ({"depth_scale": -1.0}, {"d.Z": np.where(SKY, 0, -T["planar"])}, None),
    "centimetres": ({"depth_scale": 0.01}, {"d.Z": np.where(SKY, 0, 100 * T["planar"])}, None),
    "z up": ({"up": "z"}, {"n.XYZ": Z_UP}, 'up = "z"'),
    "left": ({"handed": "left"}, {"n.XYZ": T["normal"] * (1, 1, -1) + 0.0}, None),
    "opengl": ({"normal_space": "opengl"}, {"n.XYZ": _view(True)}, 'normal_space = "opengl"'),
    "opencv": ({"normal_space": "opencv"}, {"n.XYZ": _view(False)}, 'normal_space = "opencv"'),
    "negated": ({"normal_scale": [-1, -1, -1]}, {"n.XYZ": -T["normal"]}, "normal_scale with all signs"),
    "encoded": ({"normal_encoded": True}, {"n.XYZ": (T["normal"] + 1) / 2 * T["hit"][..., None]}, "normal_encoded"),
    "uv": ({"motion_unit": "uv"}, {"m.XY": UV}, 'motion_unit = "uv" fits'),
    "offset": ({"motion_offset": [0.5, 0.25]}, {"m.XY": T["motion"] + (0.5, 0.25)}, None),
    "next": ({"motion_target": "next"}, {"m.XY": -T["motion"]}, "motion_scale with both signs"),
    "y up": ({"motion_scale": [1, -1]}, {"m.XY": T["motion"] * (1, -1)}, "motion_scale with the sign of y"),
}


@pytest.mark.parametrize("name", SETTINGS)
def test_a_setting_converts_and_without_it_the_disagreement_names_it(name: str, tmp_path: Path) -> None:
    settings, layers, told = SETTINGS[name]
    path = write(tmp_path / "a.exr", PLAIN | layers)
    frame = read_gbuffer(path, _own(tmp_path, **settings), camera=CAMERA, previous_camera=BEFORE)
    frame.validate()
    g = frame.gbuffer
    assert g.motion is not None
    for found, true in ((g.depth, T["planar"][..., None]), (g.normal, T["normal"]), (g.motion, T["motion"])):
        assert np.abs(found[0].permute(1, 2, 0).numpy() - true)[T["hit"]].max() < 1e-2
    assert disagreements(frame) == []
    if told is not None:
        lines = disagreements(read_gbuffer(path, _own(tmp_path), camera=CAMERA, previous_camera=BEFORE))
        assert any(told in line for line in lines), lines


@pytest.mark.parametrize("kind", ["planar", "ray"])
def test_the_kind_told_is_another_than_the_profile_has(kind: str, tmp_path: Path) -> None:
    """Plain depth under the name that Nuke gives to 1 / z, which its own profile finds by the pixels."""
    path = write(tmp_path / "a.exr", {"depth.Z": np.where(SKY, 1e10, T[kind]), "N.XYZ": T["normal"], "RGB": GREY})
    assert detect(path).name == "nuke"
    assert disagreements(read_gbuffer(path, camera=CAMERA), depth_kind=kind) == []
    (tmp_path / "own.toml").write_text('base = "nuke"\ndepth_kind = "reciprocal"')
    (line, *_) = disagreements(read_gbuffer(path, tmp_path / "own.toml", camera=CAMERA), depth_kind="reciprocal")
    assert line.startswith(f'depth_kind = "{kind}" fits better')
    (tmp_path / "own.toml").write_text(f'base = "nuke"\ndepth_kind = "{kind}"')
    frame = read_gbuffer(path, tmp_path / "own.toml", camera=CAMERA)
    assert disagreements(frame, depth_kind=kind) == []


@pytest.mark.parametrize(
    ("depth", "told"),
    [
        (-T["planar"], "all of d.Z is negative; set depth_scale = -1"),
        (np.zeros(SIZE), "d.Z is 0 to 0, which is all sky"),
    ],
)
def test_depth_without_a_surface_is_told(depth: np.ndarray, told: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", {"d.Z": np.where(SKY, 0, depth)})
    with pytest.warns(UserWarning, match=f"has no surface: {told}"):
        frame = read_gbuffer(path, _own(tmp_path), camera=CAMERA)
    assert not bool(frame.gbuffer.hit.any())


def test_albedo_is_decoded(tmp_path: Path) -> None:
    frame = read_gbuffer(write(tmp_path / "a.exr", PLAIN), _own(tmp_path, albedo_space="srgb"), camera=CAMERA)
    assert frame.gbuffer.albedo is not None
    assert float(frame.gbuffer.albedo.max()) == pytest.approx(0.21404, abs=1e-4)


def test_view_layers_with_dots_are_kept_apart(tmp_path: Path) -> None:
    planes = {f"{v}.Depth.Z": np.full(SIZE, d) for v, d in (("a.b", 2.0), ("c", 3.0))}
    others = {name: np.full(SIZE, 0.3) for name in ("a.b.Metallic.X", "c.Roughness.X")}
    path = write(tmp_path / "a.exr", planes | others)
    with pytest.warns(UserWarning, match=r"depth is in the layers a\.b, c; a\.b is taken"):
        frame = read_gbuffer(path, fov=40)
    assert float(frame.gbuffer.depth.max()) == 2
    assert frame.gbuffer.roughness is None  # that of the other view layer


def test_a_dot_in_the_name_of_depth_makes_no_view_layer(tmp_path: Path) -> None:
    """As Mitsuba's manual calls its depth: dd.y, whose channel is dd.y.T."""
    layers = {"dd.y.T": np.where(SKY, 0, T["ray"]), "nn.XYZ": T["normal"], "albedo.RGB": GREY, "img.RGB": GREY}
    frame = read_gbuffer(write(tmp_path / "a.exr", layers), "mitsuba", camera=CAMERA)
    assert frame.composite is not None
    assert frame.gbuffer.albedo is not None
    assert "normal_estimated" not in frame.extra


def test_channels_of_parts_carry_the_names_of_their_parts(tmp_path: Path) -> None:
    parts = {"depth": {"Z": np.full(SIZE, 4.0)}, "other": {"Z": np.full(SIZE, 9.0)}}
    assert float(read_gbuffer(write_parts(tmp_path / "a.exr", parts), fov=40).gbuffer.depth.max()) == 4


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("sky = 'x'", "sky must be a number"),
        ("motion_scale = [1]", "motion_scale must be two numbers"),
        ("reversed = 1", "reversed must be true or false"),
        ("up = ['y']", "up must be 'y' or 'z'"),
        ("channels = 3", "channels must be a table"),
        ("[channels]\ndepth = 'd'", "channels must be a table of lists"),
        ("[channels]\ndepht = ['d']", "unknown channel 'depht'"),
        ("colour = 1", "unknown key 'colour'"),
        ("base = 'nuk'", "base must be one of blender"),
        ("depth_scale = 0", "depth_scale must be a number other than 0"),
        ("near = 5\nfar = 2\n[channels]\ndepth = ['d']", "near and far must satisfy"),
        ("", "must name its depth"),
    ],
)
def test_wrong_profiles_name_the_key(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=told.replace("[", r"\[")):
        load_profile(path)


def test_a_misspelt_profile_is_told_what_it_may_mean() -> None:
    with pytest.raises(ValueError, match=r"one of auto, .*, got 'mitsbua' \(did you mean mitsuba\?\)"):
        load_profile("mitsbua")


def test_a_static_world_has_motion_without_a_layer_of_it(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", {"d.Z": PLAIN["d.Z"], "n.XYZ": PLAIN["n.XYZ"]})
    g = read_gbuffer(path, _own(tmp_path), camera=CAMERA, previous_camera=BEFORE).gbuffer
    assert g.motion is not None
    assert g.motion_z is not None
    assert torch.allclose(g.motion_z, CAMERA.static_motion(BEFORE, g.depth, g.hit)[1])


def test_normals_of_unreal_may_be_stored_either_way(tmp_path: Path) -> None:
    plain = np.stack([X, Z, Y], -1)
    found = [
        read_gbuffer(
            write(tmp_path / f"{n}.exr", FILES["unreal"] | {"QueueWorldNormal.RGB": normals}), camera=CAMERA
        ).gbuffer.normal
        for n, normals in enumerate((plain, plain / 2 + 0.5))
    ]
    assert torch.allclose(found[0], found[1], atol=1e-6)


def test_depth_beyond_all_scenes_is_sky(tmp_path: Path) -> None:
    depth, places = T["planar"].copy(), T["hit"].nonzero()
    for i, claimed in enumerate((3e38, 2e12, 9e11)):
        depth[places[0][i], places[1][i]] = claimed
    path = write(tmp_path / "a.exr", FILES["houdini"] | {"Pz.Z": np.where(SKY, 1e30, depth)})
    frame = read_gbuffer(path, camera=CAMERA)
    assert frame.gbuffer.hit[0, 0].numpy()[places][:3].tolist() == [False, False, True]
    assert bool(torch.isfinite(frame.gbuffer.depth).all())
