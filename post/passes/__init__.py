"""All passes: one file a pass, and nothing else."""
