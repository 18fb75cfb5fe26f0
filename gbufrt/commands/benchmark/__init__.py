"""What `gbufrt bench` measures, and the bars that it must reach."""
