"""What `gbufrt inspect` finds out about files, and how it shows it."""
