"""Blue noise and low-discrepancy sequences: the only source of randomness."""
