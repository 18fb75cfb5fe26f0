"""Charts that the reports of ablate and bench share."""
