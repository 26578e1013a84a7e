"""Body tracks: a recorded person's rig, its pose in every frame, and a mesh bound to it."""

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from ico3d.common.files import write_one_of_many
from ico3d.common.typed import parse_json
from ico3d.common.unpacking.heads import SMALL_HEAD, check_head
from ico3d.errors import CaptureError
from ico3d.rig.binding import INFLUENCES, Binding
from ico3d.rig.quaternions import Array
from ico3d.rig.rig import Rig

NAME = "body_track.safetensors"
"""Name of the file in a recording's folder."""
VERSION = 1
"""Version of the file."""
MOST_BYTES = 1 << 28
"""Largest size in bytes of a file: two hours of 80 joints take as much."""
NUMBERS = {
    "joints": np.float64,
    "rotations": np.float32,
    "roots": np.float32,
    "fitted": np.uint8,
    "vertices": np.float32,
    "faces": np.int32,
    "vertex_joints": np.uint8,
    "vertex_weights": np.float32,
}
"""Types of the arrays: of narrower ones, what is computed would be many times as large."""
MOST_VERTICES, MOST_FACES = 1 << 20, 1 << 21
"""Of a surface; each vertex takes 200 bytes more while it is moved."""
_DAMAGE = (ValueError, KeyError, TypeError, OverflowError, AttributeError)
"""What damaged files raise; AttributeError for kinds of numbers that numpy has not."""
LONGEST = 1e3
"""Largest coordinate of roots and vertices in metres that a file may hold."""


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """The motion of a recorded person in F frames.

    Attributes:
        rig: The skeleton of J joints, in the person's own proportions.
        fps: Frames per second; frame i is at i / fps seconds.
        rotations: (F, J, 4) float32 local rotation of each joint, wxyz (`Rig.posed`).
        roots: (F, 3) float32 translation of the root from rest to the world, metres.
        fitted: (F,) bool: frames that were fitted; poses of other frames are interpolated.
        vertices: (V, 3) float32 surface of the template in the person's shape at rest, metres.
        faces: (T, 3) int32 corners of the surface's triangles, counter-clockwise from outside.
        binding: Joints that carry the vertices.
        source: What the template is and to what it was fitted, in words.
        licence: Licence of the template where it allows less than this project's; else empty.
    """

    rig: Rig
    fps: float
    rotations: np.ndarray
    roots: np.ndarray
    fitted: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    binding: Binding
    source: str
    licence: str = ""

    @property
    def num_frames(self) -> int:
        """Number F of frames."""
        return len(self.rotations)

    def until(self, frames: int) -> "BodyTrack":
        """The track of the first `frames` frames."""
        parts = (self.rotations[:frames], self.roots[:frames], self.fitted[:frames])
        return replace(self, rotations=parts[0], roots=parts[1], fitted=parts[2])

    def joints(self) -> Array:
        """(F, J, 3) positions of the joints in the world, metres."""
        return self.rig.posed(self.rotations, self.roots)[1]

    def surface(self, frame: int) -> Array:
        """(V, 3) positions of the vertices in the world at a frame, metres."""
        matrices = self.rig.matrices(self.rotations[frame], self.roots[frame])
        return self.binding.skinned(self.vertices, matrices)

    def credited(self, provenance: dict[str, Any]) -> dict[str, Any]:
        """Provenance of what is made from this track: the template's licence is added.

        Args:
            provenance: Provenance of the recording, with keys `sources` and `licence`.
        """
        if not self.licence:
            return provenance
        licences = (provenance["licence"], self.licence)
        return provenance | {
            "sources": [*provenance["sources"], self.source],
            "licence": "; ".join(filter(None, licences)),
        }

    def to_bytes(self) -> bytes:
        """Content of the file of this track."""
        about = {
            "version": VERSION,
            "fps": self.fps,
            "names": self.rig.names,
            "parents": self.rig.parents,
            "source": self.source,
            "licence": self.licence,
        }
        arrays = {
            "joints": self.rig.joints.astype(np.float64),
            "rotations": self.rotations.astype(np.float32),
            "roots": self.roots.astype(np.float32),
            "fitted": self.fitted.astype(np.uint8),
            "vertices": self.vertices.astype(np.float32),
            "faces": self.faces.astype(np.int32),
            "vertex_joints": self.binding.joints,
            "vertex_weights": self.binding.weights.astype(np.float32),
        }
        arrays = {name: np.ascontiguousarray(value) for name, value in arrays.items()}
        return save(arrays, {"body_track": json.dumps(about)})


def track_file(recording: Path) -> Path:
    """File of a recording's body track: in its folder, or beside a recording that is a file."""
    return recording / NAME if os.path.isdir(recording) else recording.with_suffix(f".{NAME}")


def write_body_track(track: BodyTrack, recording: Path) -> Path:
    """Writes the body track of a recording atomically; returns the file.

    Raises:
        CaptureError: If the file cannot be written.
        StorageError: If the disk has no room for it and some more.
    """
    file = track_file(recording)
    try:
        write_one_of_many(file, track.to_bytes())
    except OSError as error:
        raise CaptureError(
            f"{file} cannot be written ({error.strerror}): a body track lies with its recording; "
            f"make a copy of your own with ico3d capture resize {recording} OUT."
        ) from error
    return file


def read_body_track(recording: Path, num_frames: int, fps: float) -> BodyTrack | None:
    """Reads the body track of a recording.

    Args:
        recording: Path of the recording, `Capture.path`.
        num_frames: Number of frames of the recording.
        fps: Frames per second of the recording.

    Returns:
        The track; None where there is no file.

    Raises:
        CaptureError: If the file is damaged or belongs to another recording.
    """
    file = track_file(recording)
    if not os.path.isfile(file):
        return None
    try:
        track = _read(file)
    except (OSError, SafetensorError, *_DAMAGE) as error:
        raise CaptureError(
            f"{file} is damaged ({error}): delete it and run ico3d capture pose again."
        ) from error
    if (track.num_frames, track.fps) != (num_frames, fps):
        raise CaptureError(
            f"{file} has {track.num_frames} frames at {track.fps:g} per second, the recording has "
            f"{num_frames} at {fps:g}: delete it and run ico3d capture pose again."
        )
    return track


def _read(file: Path) -> BodyTrack:
    """Reads a file of a body track.

    Raises:
        OSError, SafetensorError, or one of `_DAMAGE`: If it is damaged.
    """
    if file.stat().st_size > MOST_BYTES:
        raise ValueError(f"it has more than {MOST_BYTES >> 20} MiB")
    check_head(file, SMALL_HEAD)
    with cast(Any, safe_open(file, "numpy")) as content:  # untyped
        text = cast(dict[str, str], content.metadata() or {}).get("body_track", "{}")
        names = cast(list[str], content.keys())
        arrays: dict[str, np.ndarray] = {name: content.get_tensor(name) for name in names}
    described: object = parse_json(text.encode(), file.name, ValueError)
    if not isinstance(described, dict):
        raise TypeError("its description is no object")
    about = cast(dict[str, Any], described)
    if about.get("version") != VERSION:
        raise ValueError(f"its version is {about.get('version')}, not {VERSION}")
    rig = Rig(tuple(map(str, about["names"])), tuple(map(int, about["parents"])), arrays["joints"])
    frames, vertices = len(arrays["rotations"]), len(arrays["vertices"])
    if vertices > MOST_VERTICES or len(arrays["faces"]) > MOST_FACES:
        raise ValueError(f"its surface has more than {MOST_VERTICES} vertices")
    shapes = {
        "joints": (len(rig), 3),
        "rotations": (frames, len(rig), 4),
        "roots": (frames, 3),
        "fitted": (frames,),
        "vertices": (vertices, 3),
        "faces": (len(arrays["faces"]), 3),
        "vertex_joints": (vertices, INFLUENCES),
        "vertex_weights": (vertices, INFLUENCES),
    }
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"'{name}' must be {shape}, found {arrays[name].shape}")
        if arrays[name].dtype != NUMBERS[name]:
            kind = np.dtype(NUMBERS[name])
            raise ValueError(f"'{name}' must be {kind}, found {arrays[name].dtype}")
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"'{name}' holds NaN or infinity")
    _check_values(arrays, len(rig), vertices)
    return BodyTrack(
        rig,
        float(about["fps"]),
        arrays["rotations"],
        arrays["roots"],
        arrays["fitted"].astype(bool),
        arrays["vertices"],
        arrays["faces"],
        Binding(arrays["vertex_joints"], arrays["vertex_weights"]),
        str(about["source"]),
        str(about.get("licence", "")),
    )


def _check_values(arrays: dict[str, np.ndarray], joints: int, vertices: int) -> None:
    """Checks rotations, lengths, indices and weights.

    Raises:
        ValueError: If one of them is invalid.
    """
    if np.abs(np.linalg.norm(arrays["rotations"], axis=-1) - 1).max(initial=0) > 1e-3:
        raise ValueError("'rotations' holds one that is not of length 1")
    for name in ("roots", "vertices"):
        if np.abs(arrays[name]).max(initial=0) > LONGEST:
            raise ValueError(f"'{name}' reaches farther than {LONGEST:g} m")
    faces, weights = arrays["faces"], arrays["vertex_weights"]
    if faces.size and not (faces.min() >= 0 and faces.max() < vertices):
        raise ValueError("'faces' names a vertex that is not there")
    if arrays["vertex_joints"].max(initial=0) >= joints:
        raise ValueError("'vertex_joints' names a joint that is not there")
    if weights.min(initial=0) < 0 or np.abs(weights.sum(1) - 1).max(initial=0) > 1e-3:
        raise ValueError("'vertex_weights' has a row that does not sum to 1")
