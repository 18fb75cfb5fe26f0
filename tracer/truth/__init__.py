"""Ray-traced truth: what the passes are measured against."""
