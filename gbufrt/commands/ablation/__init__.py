"""Ablation: which passes earn their place, how far each is from the truth, and what each costs."""

from gbufrt.commands.ablation.plan import Plan
from gbufrt.commands.ablation.sweep import Results, ablate

__all__ = ["Plan", "Results", "ablate"]
