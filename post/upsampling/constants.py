"""Constants that both forms of upsampling share."""

# of joint bilateral upsampling, see `post.upsampling.reference`
DEPTH_SENSITIVITY = 1.0  # of `post.filters.edges.edge_weight`, where the spacing of the samples is the unit
NORMAL_POWER = 8.0  # of the cosine between normals, in the same weight
ENOUGH = 0.1  # share of the bilinear weight: where less lies on the pixel's surface, sixteen samples count, not four
ELSEWHERE = 1e-4  # weight of samples on another surface: a pixel without a sample of its own takes their mean
FAR_SHARE = 1e-3  # of the twelve samples that are not the nearest four

# of `post.upscale`: how samples count by their distance; exp(SAMPLE_WINDOW * d^2) falls to a tenth at 0.88 pixels
SAMPLE_WINDOW = -3.0  # where there is history; d in pixels of the large picture; as `post.history.constants.WINDOW`
FIRST_WINDOW = -3.4  # without history, d in pixels of the small picture: one sample must do for all around it
BOX_WINDOW = -0.5  # d in pixels of the small picture, of the neighbours that bound what a history may hold
STEPPED = 0.6  # how far a history's pixels are read as steps between their neighbours; the rest as slopes
LEAST_WEIGHT = 1e-4  # of a frame that has no sample near a pixel: its history then stays, but is not divided by 0
ALONG = 0.25  # factor on squared distances along an edge, where samples are few: they tell more of it than those beside
FLAT = 1.5e-2  # squared differences of tone-mapped luminance over 3x3 pixels, below which noise has no edges

# how far a history is believed
FOLLOWS = 0.5  # most of what a history changes between the pixel and the samples that colours are corrected by
TRUSTED = 0.1  # weight of a history at which half of `FOLLOWS` is reached
MATURE = 1.0  # weight of samples from which on a pixel has its history's window, and edges run as that shows them
KNOWN = 0.6  # weight of samples from which on those of a frame count by their distance; below it more and more alike
FEW = 2.0  # frames: where they weigh less, as at large ratios, that stands for `KNOWN`
LEAVES = 0.5  # pixels a frame by which neighbours must move otherwise to show what they hid; one more shows all of it
HID = 2.0  # factor on the share of the samples around that hid a pixel before, up to 1
LOST_BETWEEN = 0.06  # share of a history's weight lost where it is read half way between pixels, since that blurs it
LOST_MOVING = 0.15  # share lost besides for each pixel of movement, up to `FASTEST`
LOST_SHEARED = 0.4  # share lost for each pixel by which neighbours move otherwise: surfaces beside it come into view
FASTEST = 2.0  # pixels a frame

# how a history is clipped: one of few samples is little better than those of this frame, one of many is
NARROWEST = 3.0  # factor on the sides of its box where a history has no weight
WIDEST = 5.0  # that factor for a history of `WIDEST_AT` frames
MIRRORS = 0.5  # share of its sides that a box loses where all light is mirrored, which changes though nothing moves
WIDEST_AT = 12.0  # frames' mean weight
DISTRUST = 6.0  # by how much clipping takes weight from a history: a change of 1 / DISTRUST halves it

# thin features, which samples miss in most frames, are locked
DECAY = 0.1  # share of a lock that a sample at the pixel's centre uses up, so that it ends when the feature has gone
PARTING = 0.5  # pixels a frame by which the motion of a feature and of what is seen in its place differ
COVERED = 0.02  # of its depth: what is nearer by more hides the feature, and ends its lock
NEW_SHARE = 0.2  # of the present frame in the running means of how clipping moves a history
STEADY = 1e-3  # mean movement that is told from none: clipping that always pulls one way is right
LOCK_WIDENS = 8.0  # standard deviations that a lock adds to the box that clips a history

# which surface was there before
IN_FRONT = 0.05  # of its depth: a surface nearer by more hides the other, and pixels at the edge are its own
STRETCH = 1.5  # most by which a surface's plane may carry its depth on, as a factor: beyond it planes mislead
TOLERANCE = 0.1  # of its depth by which a surface may lie behind all that was seen there
EDGE_ON = 1e-3  # cosine to the ray below which a surface has no plane to carry its depth on
