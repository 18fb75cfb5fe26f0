"""What filters share: edges, signals, moments."""
