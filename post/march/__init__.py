"""Screen-space rays through a depth pyramid."""
