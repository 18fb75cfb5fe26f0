"""What the commands are given: groups of options, values as typed, settings of passes, and checks before torch."""
