"""Light that fog scatters: places along rays, and the lamps that shine there."""
