"""Banks of water with waves, over the wave and below the face of still water."""

from __future__ import annotations

import torch
import voxels

from gbufrt import Camera
from tracer import Waves, render
from tracer.scene.scene import Scene, Sun

TOP, AMPLITUDE = 4, 0.3
SUN = Sun(direction=(0.0, 0.6, 0.8), irradiance=(3.0, 3.0, 3.0))
NEAR = Camera.look_at((5.0, 9.0, 40.0), (24.0, 4.0, 20.0), size=(45, 80), fov_y=50.0)


def test_banks_over_the_waves_are_as_light_as_without_water() -> None:
    """The face of still water took half of the light from a strip along the shore."""
    stone, basin = (voxels.STONE, (0, 0, 0), (48, 5, 48)), (0, (2, 2, 2), (46, 8, 46))
    full = voxels.world((48, 8, 48), stone, basin, (voxels.WATER, (2, 2, 2), (46, TOP, 46)))
    waves = Waves(amplitude=AMPLITUDE, frequency=0.4, caustics=0.0)
    frame = render(Scene(world=full, waves=waves, sun=SUN, sky=voxels.DARK), NEAR)
    empty = render(Scene(world=voxels.world((48, 8, 48), stone, basin), sun=SUN, sky=voxels.DARK), NEAR)
    g = frame.gbuffer
    height = g.camera.to_world(g.points_view())[0, 1]
    assert g.material_id is not None
    bank = (g.material_id[0, 0] == voxels.STONE) & (g.normal[0, 2] > 0.9) & (height < TOP) & (height > TOP - AMPLITUDE)
    assert int(bank.sum()) > 10
    lit, wanted = (f.read("radiance")[0][:, bank] for f in (frame, empty))
    assert float(wanted.min()) > 0
    torch.testing.assert_close(lit, wanted, rtol=0.01, atol=0)
