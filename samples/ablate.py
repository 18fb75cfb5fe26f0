"""What is ambient occlusion worth, by which method, and at what radius? A report against ray-traced truth."""

from pathlib import Path

from gbufrt.commands.ablation import Plan, ablate

plan = Plan(
    out=Path("out"),
    views=("hall", "plaza"),
    size=(135, 240),
    variants=("passes", "ao.estimate.method=horizon"),
    sweeps=("gtao.radius=0.5:4:4",),
    only=("ao", "frame"),
)
for row in ablate(plan).rows:
    if row.value is not None:
        print(f"{row.name}: {row.what}: {row.value:.3f} in the worst view, {row.view} (must reach {row.bound:g})")
print("see out/report.html")
