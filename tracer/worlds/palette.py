"""Materials of the built-in worlds: linear albedos, with lamps scaled to a sun of irradiance 3."""

from __future__ import annotations

from functools import cache

from tracer.scene.material import RGB, Material, MaterialTable

MATTE: dict[str, RGB] = {
    "grass": (0.155, 0.235, 0.058),
    "meadow": (0.215, 0.270, 0.070),
    "moss": (0.095, 0.165, 0.052),
    "dirt": (0.175, 0.112, 0.066),
    "path": (0.360, 0.270, 0.175),
    "sand": (0.560, 0.455, 0.290),
    "silt": (0.210, 0.200, 0.140),
    "rock": (0.300, 0.275, 0.250),
    "rock_dark": (0.195, 0.185, 0.180),
    "rock_warm": (0.385, 0.300, 0.225),
    "rock_pale": (0.450, 0.410, 0.350),
    "snow": (0.780, 0.800, 0.830),
    "bark": (0.115, 0.075, 0.048),
    "birch_bark": (0.580, 0.555, 0.500),
    "leaf": (0.088, 0.185, 0.040),
    "leaf_light": (0.180, 0.285, 0.058),
    "pine": (0.042, 0.105, 0.052),
    "pine_light": (0.075, 0.150, 0.066),
    "leaf_gold": (0.520, 0.330, 0.055),
    "leaf_red": (0.440, 0.105, 0.040),
    "blossom": (0.660, 0.330, 0.390),
    "blossom_light": (0.760, 0.500, 0.540),
    "flower_white": (0.740, 0.720, 0.660),
    "flower_violet": (0.300, 0.160, 0.520),
    "flower_yellow": (0.680, 0.470, 0.070),
    "reed": (0.290, 0.310, 0.100),
    "planks": (0.330, 0.205, 0.110),
    "timber": (0.130, 0.078, 0.045),
    "plaster": (0.720, 0.670, 0.580),
    "plaster_ochre": (0.620, 0.420, 0.180),
    "plaster_rose": (0.600, 0.300, 0.230),
    "plaster_blue": (0.230, 0.360, 0.480),
    "roof_clay": (0.460, 0.150, 0.080),
    "roof_slate": (0.130, 0.150, 0.190),
    "roof_moss": (0.170, 0.215, 0.100),
    "masonry": (0.410, 0.385, 0.350),
    "masonry_dark": (0.230, 0.220, 0.215),
    "cobble": (0.330, 0.310, 0.285),
    "red_wall": (0.560, 0.110, 0.070),
    "teal_wall": (0.080, 0.330, 0.340),
    "white_wall": (0.780, 0.760, 0.720),
    "canvas": (0.700, 0.640, 0.520),
    "cloth_red": (0.500, 0.070, 0.060),
    "cloth_blue": (0.070, 0.140, 0.360),
    "skin": (0.550, 0.330, 0.220),
    "hair": (0.060, 0.038, 0.025),
    "hay": (0.580, 0.430, 0.150),
}

SPECIAL: tuple[Material, ...] = (
    Material(
        name="water", albedo=(0.02, 0.09, 0.11), roughness=0.05, opacity=0.3, tint=(0.62, 0.86, 0.88), variation=0.0
    ),
    Material(name="foam", albedo=(0.62, 0.72, 0.76), roughness=0.6, variation=0.1),
    Material(
        name="glass", albedo=(0.30, 0.36, 0.38), roughness=0.03, opacity=0.15, tint=(0.88, 0.94, 0.95), variation=0.0
    ),
    Material(name="marble", albedo=(0.70, 0.67, 0.61), roughness=0.10, variation=0.05),
    Material(name="marble_dark", albedo=(0.075, 0.085, 0.10), roughness=0.07, variation=0.10),
    Material(name="tile_teal", albedo=(0.06, 0.20, 0.22), roughness=0.12, variation=0.10),
    Material(name="gold", albedo=(0.83, 0.58, 0.20), roughness=0.20, metallic=1.0, variation=0.04),
    Material(name="copper", albedo=(0.78, 0.43, 0.29), roughness=0.28, metallic=1.0, variation=0.06),
    Material(name="iron", albedo=(0.30, 0.29, 0.28), roughness=0.45, metallic=1.0, variation=0.10),
    Material(name="lamp", albedo=(0.80, 0.66, 0.44), roughness=0.5, emission=(11.0, 5.2, 1.6), variation=0.0),
    Material(name="lantern", albedo=(0.80, 0.55, 0.35), roughness=0.6, emission=(5.5, 2.0, 0.55), variation=0.0),
    Material(name="ember", albedo=(0.60, 0.30, 0.15), roughness=0.9, emission=(5.0, 1.5, 0.3), variation=0.1),
    Material(name="crystal", albedo=(0.30, 0.60, 0.66), roughness=0.15, emission=(0.2, 1.1, 1.35), variation=0.1),
    Material(name="amethyst", albedo=(0.50, 0.32, 0.66), roughness=0.15, emission=(0.7, 0.28, 1.3), variation=0.1),
)


@cache
def palette() -> MaterialTable:
    """The table shared by the built-in worlds and their models."""
    matte = [Material(name=name, albedo=albedo, roughness=0.9, variation=0.09) for name, albedo in MATTE.items()]
    return MaterialTable.of([*matte, *SPECIAL])
