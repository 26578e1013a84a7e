"""Generates `viewer/src/shared.ts`: constants that Python and the page share.

Run `python -m ico3d.chat.generating` after each change of one of these values.
"""

import json
from pathlib import Path
from typing import Any

from ico3d.bundle import animation, backdrop, limits, manifest
from ico3d.bundle.skinned.gestures import GESTURES
from ico3d.chat.observing.timing import PARTS
from ico3d.chat.wire.protocol_visits import MAX_NOTE, MAX_NOTES
from ico3d.common.expression import (
    EYE_NAMES,
    EYE_UNIT,
    LEAKY_SLOPE,
    LIDS,
    MOST_DISPLACEMENTS,
    MOVE_HIDDEN,
)
from ico3d.common.spz import container
from ico3d.motion import clip, roles
from ico3d.rig import shadow_map
from ico3d.rig.rig import MOST_JOINTS
from ico3d.speech import eyes

TARGET = Path(__file__).parents[4] / "viewer" / "src" / "shared.ts"

HEAD = "// Written by `python -m ico3d.chat.generating` from the files of `src/ico3d` named.\n"

VALUES: tuple[tuple[str, str, Any], ...] = (
    ("BUNDLE_FORMAT", "What a manifest calls itself; bundle/manifest.py.", manifest.FORMAT),
    ("BUNDLE_VERSION", "The newest version of a manifest.", manifest.VERSION),
    ("OLDEST_BUNDLE", "The oldest version that is read.", manifest.OLDEST),
    ("MAX_GAUSSIANS", "Of a head or a window of a body; bundle/limits.py.", limits.MAX_GAUSSIANS),
    (
        "SPZ",
        "What SPZ files may unpack to, and their highest degree; common/spz/container.py.",
        {
            "ratio": container.MAX_RATIO,
            "free": container.FREE_BYTES,
            "degree": container.MAX_DEGREE,
        },
    ),
    (
        "MOST",
        "What else a bundle may have: a head's counts, a body's frames, files and their bytes.",
        {
            "rank": limits.MAX_RANK,
            "blended": limits.MAX_BLENDED,
            "moved": limits.MAX_MOVED,
            "body_rank": limits.MAX_BODY_RANK,
            "samples_per_frame": limits.MAX_SAMPLES_PER_FRAME,
            "displacements": MOST_DISPLACEMENTS,
            "eye_turn": limits.MAX_EYE_TURN,
            "hidden": limits.MAX_HIDDEN,
            "expression_size": limits.MAX_EXPRESSION_SIZE,
            "num_poses": limits.MAX_POSES,
            "window_frames": limits.MAX_WINDOW_FRAMES,
            "posed_frames": limits.MAX_POSED_FRAMES,
            "known_poses": limits.MAX_KNOWN_POSES,
            "files": limits.MAX_FILES,
            "file_bytes": limits.MAX_FILE_BYTES,
            "bundle_bytes": limits.MAX_BUNDLE_BYTES,
            "manifest_bytes": limits.MAX_MANIFEST_BYTES,
        },
    ),
    (
        "SMALLER",
        "Most bytes of files that may be less large than others, by name.",
        {
            animation.ANIMATION: animation.MAX_BYTES,
            GESTURES: clip.MOST_BYTES,
            **dict.fromkeys(backdrop.BACKGROUNDS, limits.MAX_BACKGROUND_BYTES),
        },
    ),
    ("EYE_UNIT", "Metres per radian of a unit of what turns a head's eyes.", EYE_UNIT),
    ("MOVE_HIDDEN", "Width of the network of a head's displacements.", MOVE_HIDDEN),
    ("MAX_SHAPES", "Residual shapes of a body on a skeleton.", limits.MAX_SHAPES),
    ("MAX_JOINTS", "Of a body's skeleton; rig/rig.py.", MOST_JOINTS),
    ("MAX_CLUSTERS", "Groups of Gaussians in a window that move alike.", limits.MAX_CLUSTERS),
    ("MAX_CASTERS", "Spheres that cast its shadow.", limits.MAX_CASTERS),
    (
        "SHADOW",
        "The map in which a lamp sees a body, in metres; rig/shadow_map.py.",
        {
            "radius": shadow_map.RADIUS,
            "texel": shadow_map.TEXEL,
            "side": shadow_map.SIDE,
            "off": shadow_map.OFF,
            "bias": shadow_map.BIAS,
            "edge": shadow_map.EDGE,
            "wrap": shadow_map.WRAP,
        },
    ),
    ("MAX_NOTES", "Sentences of earlier visits; chat/wire/protocol_visits.py.", MAX_NOTES),
    ("MAX_NOTE", "Characters of each.", MAX_NOTE),
    ("LEAKY_SLOPE", "Of a head's networks; common/expression.py.", LEAKY_SLOPE),
    ("LID_NAMES", "The eyelids among blendshapes.", [EYE_NAMES[lid] for lid in LIDS]),
    ("LIDS", "Their places in the eye and brow values; common/expression.py.", LIDS),
    (
        "BLINK",
        "How a person blinks, in s; `spread` of the pauses' logarithms. Sources: speech/eyes.py.",
        {
            "closing": eyes.CLOSING,
            "closed": eyes.CLOSED,
            "opening": eyes.OPENING,
            "median": eyes.PAUSE_MEDIAN,
            "spread": eyes.PAUSE_SPREAD,
            "shortest": eyes.SHORTEST_PAUSE,
            "longest": eyes.LONGEST_PAUSE,
        },
    ),
    ("ROLES", "What joints are to gestures; motion/roles.py.", roles.ROLES),
    ("ROLE_PARENTS", "The number of each role's parent; -1 for the hips.", roles.PARENTS),
    ("LATENCY_PARTS", "Between a question and its answer, in order; observing/timing.py.", PARTS),
)
"""Name, description and value of each constant."""


def typescript() -> str:
    """The contents of `viewer/src/shared.ts`."""
    return "\n".join([HEAD, *(constant(*value) for value in VALUES)])


def constant(name: str, about: str, value: Any) -> str:
    """One documented constant; lists and records are made read-only."""
    fixed = " as const" if isinstance(value, list | tuple | dict) else ""
    return f"/** {about} */\nexport const {name} = {json.dumps(value)}{fixed};\n"
