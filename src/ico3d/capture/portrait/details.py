"""What a portrait capture says about itself in `ico3d.json`."""

import json
from pathlib import Path

import numpy as np

from ico3d.capture.face.mediapipe_face import LANDMARKS, MESH_LANDMARKS
from ico3d.capture.portrait import rigid_head
from ico3d.capture.portrait.files import DETAILS
from ico3d.capture.portrait.readings import Readings
from ico3d.capture.portrait.settings import FPS, PortraitSettings
from ico3d.capture.video import Video


def notes_of(video: Video, readings: Readings) -> list[str]:
    """What the user should know about the clip."""
    notes = []
    if readings.missing:
        some = ", ".join(map(str, readings.missing[:5])) + (", …" if readings.missing[5:] else "")
        notes.append(
            f"{len(readings.missing)} of {readings.total} frames show no face "
            f"and are left out (frames {some})"
        )
    if video.damaged or video.decoded < video.announced:
        whole = f" of {video.announced}" if video.announced else ""
        notes.append(f"the file is damaged or cut off: {video.decoded}{whole} pictures decoded")
    return notes


def save_details(
    work: Path,
    video: Video,
    readings: Readings,
    track: rigid_head.Track,
    settings: PortraitSettings,
    notes: list[str],
    seen: float,
) -> None:
    """`ico3d.json`."""
    details = {
        "format": "ico3d-portrait",
        "version": 1,
        "fps": FPS,
        "num_frames": readings.total,
        "frames_without_face": readings.missing,
        "frames_repeated": readings.repeated,
        "size": [video.width, video.height],
        "blendshape_names": list(readings.names),
        "tracker": {
            "model": f"MediaPipe face landmarker, {LANDMARKS} landmarks",
            "focal": "given" if settings.focal else "estimated",
            "focal_px": track.focal,
            "reprojection_px": reprojection_error(readings, track),
        },
        "background_seen": round(seen, 3),
        "notes": notes,
        "provenance": {
            "kind": "portrait",
            "sources": [video.path.name],
            "likeness": settings.likeness,
            "consent": settings.consent,
            "licence": settings.licence,
        },
    }
    (work / DETAILS).write_text(json.dumps(details, indent=1))


def reprojection_error(readings: Readings, track: rigid_head.Track) -> float:
    """Root mean square distance in pixels of the steadiest quarter of the landmarks."""
    error = np.stack(readings.landmarks)[:, :MESH_LANDMARKS] - track.project()
    steady = track.sigmas <= np.quantile(track.sigmas, 0.25)
    return float(np.sqrt((error[:, steady] ** 2).sum(-1).mean()))
