"""The README's pictures from a `gbufrt ablate` report: a whole frame, its truth and its error; error against time."""

import json
import shutil
import sys
from pathlib import Path

from PIL import Image

report, out = Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "out")
records = json.loads((report / "report.json").read_text())["records"]
found = next(r["pictures"] for r in records if r["subject"] == "frame" and r["variant"] == "full")
parts = [Image.open(report / found[name]).convert("RGB") for name in ("frame", "frame truth", "frame error")]
whole = Image.new("RGB", (sum(part.width for part in parts), parts[0].height))
for i, part in enumerate(parts):
    whole.paste(part, (i * part.width, 0))
out.mkdir(parents=True, exist_ok=True)
whole.save(out / "truth.jpg", quality=88)
shutil.copy(report / "front.svg", out)
