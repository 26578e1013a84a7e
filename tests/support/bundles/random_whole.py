"""A small whole person in the real format: the random head on the random body.

Run: python tests/bundle/random_whole.py OUT.ico3d
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.bundle.format import write_bundle
from ico3d.bundle.head import poses_to_bytes
from ico3d.bundle.manifest import Manifest
from support.bundles.random_body import SPANS, body_files, body_manifest, random_windows
from support.bundles.random_bundle import random_files, random_head, random_manifest, swaying_poses

FRAMES = SPANS[-1][1] + 1
ANIMATION = {
    "version": 1,
    "fps": 15.0,
    "num_frames": FRAMES,
    "rest": {"start": 0, "end": 2},
    "actions": [{"frame": 4, "score": 0.8}, {"frame": 6, "score": 0.3}],
    "min_speed": 0.6,
    "max_speed": 1.2,
}


def nodding_poses() -> np.ndarray:
    """(F, 4, 4): above the body, higher from frame to frame."""
    poses = swaying_poses(FRAMES)
    poses[:, 1, 3] = 1.5 + 0.01 * np.arange(FRAMES)
    return poses


def whole_manifest() -> Manifest:
    head = random_manifest(random_head(60))
    body = body_manifest(random_windows())
    assert head.head is not None and body.body is not None
    info = replace(head.head, fps=body.body.fps, num_poses=FRAMES)
    return replace(body, name="random person", head=info, speech=head.speech)


def whole_files() -> dict[str, bytes]:
    return {
        **random_files(random_head(60)),
        **body_files(random_windows()),
        "head_poses.safetensors": poses_to_bytes(nodding_poses()),
        "animation.json": json.dumps(ANIMATION).encode(),
    }


def write_random_whole(path: Path | str) -> Manifest:
    return write_bundle(path, whole_manifest(), whole_files())


if __name__ == "__main__":
    write_random_whole(Path(sys.argv[1]))
