"""What a lens and its shutter do, and anti-aliasing over time."""
