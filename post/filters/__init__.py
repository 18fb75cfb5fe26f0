"""What filters share: edges, signals, upsampling."""
