"""Constants that both forms of upsampling share."""

DEPTH_SENSITIVITY = 1.0  # of `post.filters.edges.edge_weight`, in spacings of the samples
NORMAL_POWER = 8.0
ENOUGH = 0.1  # share of the four nearest samples that lies on the surface, from which no others count
ANY = 1e-4  # weight that even another surface keeps, so that a pixel without its own takes a mean of what is near
ONLY_NEAR = 1e-3  # share of samples two spacings away

# of `post.upscale`
COUNTS = -3.0  # as `post.history.constants.WINDOW`: of how much samples about a pixel count, by `accumulate.near`
LEAST = 1e-4  # weight of a frame none of whose samples lie near a pixel
FIRST = -4.0  # as `COUNTS`, in pixels of the small picture: of a pixel without history
ALONG = 0.2  # of squared distances along an edge, as far as they count where nothing else is near
FLAT = 7e-3  # squared differences of luminance in 3x3 below which no edge is seen
FOLLOWS = 0.5  # most of the difference between a history at a pixel and at the samples about it that colours take on
TRUSTED = 0.1  # weight of a history from which on that is more than half of `FOLLOWS`
BOX = -1.0  # likewise: of the neighbours that bound what history may hold
MATURE = 0.6  # weight of samples from which on a pixel's history has the sharp window
DECAY = 0.1  # share of a lock that a sample in the middle of its pixel uses up
PARTING = 0.5  # pixels a frame by which a thin feature and what is seen in its place move apart
COVERED = 0.02  # of its depth by which something that covers a thin feature is nearer
SLOW = 0.2  # share of the present frame in the means of how clipping moves history
STEADY = 1e-3  # least mean movement that can be told from none
WIDER = 8.0  # standard deviations that a lock adds to the box of what else is clipped
BETWEEN = 0.1  # share of a history's weight that is lost when it is read half way between pixels, for what that blurs
STRAYS = 0.2  # share that is lost besides for each pixel of movement
SHEARS = 0.3  # likewise by which neighbours move otherwise, for surfaces beside the one that was followed
FASTEST = 2.0  # pixels a frame from which on faster movement loses no more
IN_FRONT = 0.05  # of its depth by which a surface is nearer than another, so that edges between the two are its own
STRETCH = 1.5  # most by which a plane may carry depth on, as a factor
TOLERANCE = 0.1  # of its depth by which a surface may lie behind all that was seen there
EDGE_ON = 1e-3  # cosine to the ray below which a surface has no plane to go on
ALMOST = 1e-3  # pixels before the next one that count as on it, so that rounding changes little
