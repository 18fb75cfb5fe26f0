"""Constants that both forms of upsampling share."""

DEPTH_SENSITIVITY = 1.0  # of `post.filters.edges.edge_weight`, in spacings of the samples
NORMAL_POWER = 8.0
ENOUGH = 0.1  # share of the four nearest samples that lies on the surface, from which no others count
ANY = 1e-4  # weight that even another surface keeps, so that a pixel without its own takes a mean of what is near
ONLY_NEAR = 1e-3  # share of samples two spacings away
