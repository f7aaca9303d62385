"""The most that is read of a capture, a model or a selection: whoever made it may have meant harm, or a disk gone bad.

All are far beyond what cameras and tools write, and stand in scenes/README.md with the memory and time that they allow.
"""

# JSON and text. A frame of transforms.json has 0.5 to 1.5 KB, a row of a trajectory about 100 bytes.
JSON_BYTES = 1 << 27
JSON_CONTAINERS = 4_000_000  # lists and objects: Python's take up to 80 times the bytes that they have in the file
JSON_VALUES = 32_000_000
TEXT_BYTES = 1 << 27
LINES = 2_000_000
LINE_LETTERS = 1 << 16
NUMBERS = 20_000_000  # of one table: a million 4 x 4 matrices and more
NAME_LETTERS = 4096  # of a frame: PATH_MAX of Linux
SETTINGS_BYTES = 1 << 20  # they lie in the folder that one happens to be in
STUDY_BYTES = 1 << 20
STUDY_NODES = 100_000  # of a YAML file whose aliases are written out

# Pictures. The largest that a telephone takes has 199.8 million pixels (16320 x 12240).
PIXELS = 200_000_000
IMAGE_BYTES = 1 << 30
SCANS = 100  # of a progressive JPEG: cameras write up to a dozen, and each goes over all pixels again
SIDE = 1_000_000  # pixels of a camera's width and height

# Videos. Panoramic cameras film 11,000 x 5,500.
VIDEO_BYTES = 1 << 37  # six hours at 50 Mb/s
VIDEO_PIXELS = 1 << 26  # of a frame: a decoder keeps up to seventeen of them
SAMPLES = 10_000_000  # frames of a video: four days at 30 a second
PIXEL_ASPECT = 10.0  # of a pixel's sides, either way

# Points, models and features.
PLY_HEADER_BYTES = 1 << 16
PLY_BYTES = 1 << 32  # of the vertices: 17 million Gaussians of degree 3
POINTS = 20_000_000
ASCII_POINTS = 2_000_000
COLMAP_BYTES = 1 << 32  # of all files of a model
COLMAP_TEXT_BYTES = 1 << 30  # of one that is text
COLMAP_LINE_BYTES = 1 << 26  # all the points that one image sees stand in a line
COLMAP_POINTS = 5_000_000
FEATURE_BYTES = 1 << 33  # a million rows of 1,152 numbers have 4.6 GB

# Archives that are downloaded: pictures and depth come out at no more than a few times their size.
EXPANSION = 100
EXPANSION_FREE = 1 << 28  # bytes that an archive may become whatever its size
