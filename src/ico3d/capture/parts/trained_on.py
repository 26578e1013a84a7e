"""Which pictures of which recording trained a model, so that nobody takes them for tests."""

import hashlib
from bisect import bisect_left
from collections.abc import Iterable, Sequence

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.decoding import to_bytes
from ico3d.common.files import resolved
from ico3d.errors import CaptureError


def trained_on(capture: Capture, cameras: Iterable[int], frames: Sequence[int]) -> dict:
    """The record that a model's folder keeps of its training pictures.

    Args:
        capture: The recording.
        cameras: Indices of the cameras whose pictures trained.
        frames: The frames that trained.

    Returns:
        JSON values: `path` and `fingerprint` of the recording, `cameras` (names), `frames` (pairs
        of first and last frame of each run).
    """
    return {
        "path": str(resolved(capture.path)),
        "fingerprint": fingerprint(capture),
        "cameras": [capture.cameras[camera].name for camera in cameras],
        "frames": _runs(frames),
    }


def fingerprint(capture: Capture) -> str:
    """A hash that tells recordings apart wherever they lie: clock, cameras' poses, one picture."""
    digest = hashlib.sha256(f"{capture.fps:g} {capture.num_frames}".encode())
    for camera in capture.cameras:
        digest.update(camera.name.encode())
        digest.update(np.round(camera.world_to_camera, 4).astype("<f4").tobytes())
    first = _first_picture(capture)
    if first is not None:
        digest.update(to_bytes(first).tobytes())
    return digest.hexdigest()


def check_told(summary: object) -> None:
    """Checks what a model's folder tells of its trainings, which a stranger may have written.

    Args:
        summary: The folder's summary; `recording`, `recoloured` and each of `continued`, where they
            are there, are records of `trained_on`.

    Raises:
        ValueError: If the summary is none, or a record is impossible.
    """
    if not isinstance(summary, dict):
        raise ValueError("it has no summary")
    continued = summary.get("continued", [])
    if not isinstance(continued, list):
        raise ValueError("what it continued is no list")
    for record in (summary.get("recording", {}), summary.get("recoloured", {}), *continued):
        if not isinstance(record, dict):
            raise ValueError("a record of its training is no object")
        if "cameras" in record and not (_are_names(record["cameras"]) and _are_runs(record)):
            raise ValueError("a record of its training has no names of cameras, or no frames")


def is_same_recording(record: dict, capture: Capture) -> bool:
    """Whether a record of `trained_on` tells of this recording."""
    if record.get("path") == str(resolved(capture.path)):
        return True
    return "fingerprint" in record and record["fingerprint"] == fingerprint(capture)


def check_untrained(
    records: Iterable[dict],
    capture: Capture,
    cameras: Sequence[int],
    frames: Sequence[int],
) -> None:
    """Refuses to score pictures as held out if one of them trained anything.

    Args:
        records: What the parts of a model were trained on, by `trained_on`.
        capture: The recording that is to be scored.
        cameras: Indices of the cameras that are to be scored.
        frames: Frames that are to be scored.

    Raises:
        CaptureError: If a picture of these cameras and frames trained a part of the model.
    """
    asked = {capture.cameras[camera].name for camera in cameras}
    for record in records:
        if "cameras" not in record or not is_same_recording(record, capture):
            continue
        seen = sorted(asked & set(record["cameras"]))
        taught = _first_within(record["frames"], frames)
        if seen and taught is not None:
            raise CaptureError(
                f"{capture.path}: frame {taught} by camera {seen[0]} trained this model and "
                "cannot test it: train without it (--hold-out leaves out validation pictures), or "
                "score all pictures, trained or not, by --frames all."
            )


def _first_picture(capture: Capture) -> np.ndarray | None:
    """(H, W, 3) the first picture of the first camera that recorded one."""
    for camera in range(len(capture.cameras)):
        for frame in range(capture.num_frames):
            if capture.has_image(camera, frame):
                return capture.image(camera, frame)
    return None


def _runs(frames: Iterable[int]) -> list[list[int]]:
    """First and last of each run of successive frames."""
    runs: list[list[int]] = []
    for frame in sorted(frames):
        if runs and frame == runs[-1][1] + 1:
            runs[-1][1] = frame
        else:
            runs.append([frame, frame])
    return runs


def _first_within(runs: Iterable[Sequence[int]], frames: Iterable[int]) -> int | None:
    """The first of some frames that lies in a run; however long runs are, none is counted out."""
    ordered = sorted(frames)
    found = []
    for first, last in runs:
        place = bisect_left(ordered, first)
        if place < len(ordered) and ordered[place] <= last:
            found.append(ordered[place])
    return min(found, default=None)


def _are_names(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


def _are_runs(record: dict) -> bool:
    """Whether a record's frames are pairs of whole numbers."""
    runs = record.get("frames")
    return isinstance(runs, list) and all(
        isinstance(run, list) and [type(end) for end in run] == [int, int] for run in runs
    )
