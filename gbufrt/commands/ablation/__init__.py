"""Ablation: which passes earn their place, how far each is from the truth, and what each costs."""

from gbufrt.commands.ablation.plan import Plan
from gbufrt.commands.ablation.run import ablate
from gbufrt.commands.ablation.table import Results

__all__ = ["Plan", "Results", "ablate"]
