"""Subcommands of `gbufrt`, one file each: the only place that imports both tracer and post."""
