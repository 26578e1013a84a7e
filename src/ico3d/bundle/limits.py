"""Upper limits for bundles, so that a hostile bundle cannot exhaust memory."""

import re
from collections.abc import Callable

from ico3d.rig.pose_regression import MOST_KNOWN

MAX_FILES = 256
MAX_FILE_BYTES = 256 << 20
MAX_ASIDE_BYTES = 4 << 20
"""Bytes of a file that is no part of the person's figure: licences, the thumbnail."""
MAX_BUNDLE_BYTES = 512 << 20
MAX_MANIFEST_BYTES = 1 << 20
MIN_FPS, MAX_FPS = 0.1, 1000.0
"""Recorded frames per second: what is planned in seconds has no end where a frame has none."""
FPS_RANGE = f"lie between {MIN_FPS:g} and {MAX_FPS:g}"
LONGEST = 7200.0
"""Seconds of a recorded motion."""
MAX_GAUSSIANS = 1_000_000
MAX_RANK = 64
MAX_BLENDED = 1 << 23
"""Gaussians of a head times its rank and displacements: a page keeps four numbers of each of these
several times over."""
MAX_MOVED = 1 << 22
"""What a place holds in which every window of a body takes its turn: the most Gaussians of a window
times one and the most components of positions, of rotations and of scales of any window. A page
keeps four numbers of each of these several times over, too. And the sampled times of a window,
times its clusters and ranks."""
MAX_HIDDEN = 1024
MAX_EXPRESSION_SIZE = 512
MAX_EYE_TURN = 0.5
"""Radians by which eyes may turn."""
MAX_POSES = 100_000
MAX_THUMBNAIL_SIDE = 512
MAX_NOTES = 10_000
MAX_BODY_RANK = 16
MAX_CLUSTERS = 256
MAX_WINDOW_FRAMES = 1000
MAX_SAMPLES_PER_FRAME = 8
MAX_BACKGROUND_BYTES = 64 << 20
MAX_SHAPES = 8
MAX_POSED_FRAMES = 30_000
"""Frames of a body on a skeleton, whose numbers are stored in 16 bits."""
MAX_KNOWN_POSES = MOST_KNOWN
"""Stored poses with which a page compares every pose."""
MAX_CASTERS = 20_000
"""Spheres that a page draws into a shadow map at every pose."""
MAX_CAMERA_LENGTH = 1e4
"""Metres; anything farther overflows when a camera is made of it."""

ENCODER, SHA256 = re.compile("[a-z0-9-]{1,40}"), re.compile("[0-9a-f]{64}")
"""The name of a speech encoder and the hash of its weights, of which a file's name is made."""

Require = Callable[[bool, str, str], None]
"""Raises an error unless a condition holds: the condition, the field, and what it must do."""
