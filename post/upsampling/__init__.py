"""Stages at a half or a third of the resolution, whose signals are interpolated along surfaces; and upscaling."""
