"""Tracks a video of somebody talking and writes a capture in the talking-portrait layout."""

import os
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import track as progress

from ico3d.capture.capture import Sound
from ico3d.capture.decoding import open_picture
from ico3d.capture.face.mediapipe_face import (
    MESH_LANDMARKS,
    CanonicalFace,
    canonical_face,
)
from ico3d.capture.portrait import cutout, parsing, rigid_head
from ico3d.capture.portrait.details import notes_of, reprojection_error, save_details
from ico3d.capture.portrait.exposure import even_out
from ico3d.capture.portrait.files import load_uint8, save_picture, save_torso, save_transforms
from ico3d.capture.portrait.picture_poses import align, rigid_landmarks, smoothed, spread_poses
from ico3d.capture.portrait.plate import SAMPLES, clean_plate, mismatch
from ico3d.capture.portrait.readings import Readings, read_faces, save_blendshapes, thinned
from ico3d.capture.portrait.refining import camera_of, refined
from ico3d.capture.portrait.settings import CUTOUTS, PortraitSettings
from ico3d.capture.progress import Reached, tracked
from ico3d.capture.surface.first_points import face_points, silhouette_points
from ico3d.capture.video import Video, open_video, read_sound
from ico3d.capture.writing.new_folder import check_room, new_folder
from ico3d.common.spread import spread
from ico3d.common.weights import model_file
from ico3d.errors import CaptureError

MOVING = 0.04
"""Mean difference from the clean plate, 0 to 1, above which the camera must have moved."""
console = Console(stderr=True)


def track_portrait(
    video: Path, out: Path, settings: PortraitSettings, reached: Reached | None = None
) -> None:
    """Tracks a video and writes the capture; `out` appears only once it is complete.

    Args:
        video: A video of one person by a fixed camera.
        out: Folder to make.
        settings: Size, focal length, and data for the avatar's manifest.
        reached: Told about progress.

    Raises:
        CaptureError: If `out` exists, or the video cannot be read or shows no face.
        SettingsError: If CUDA is asked for and does not work.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face model is not installed.
    """
    if os.path.exists(out):
        raise CaptureError(f"{out} exists already: remove it or choose another folder.")
    model = model_file("face_landmarker.task", "tracking a portrait")
    opened = open_video(video, settings.size)
    if settings.refine:
        from ico3d.splat.device import computing_device

        computing_device(settings.device)  # better known now than after the tracking
    with new_folder(out, settings.likeness, (video.name,)) as work:
        _write(work, opened, model, settings, reached)
    name = escape(str(out))
    console.print(f"[green]capture written to {name}[/]; look at it: ico3d capture check {name}")


def _write(
    work: Path, video: Video, model: Path, settings: PortraitSettings, reached: Reached | None
) -> None:
    """Writes all files of the capture."""
    readings = read_faces(work, video, model, console, reached)
    notes = notes_of(video, readings)
    canonical = canonical_face(model)
    given = settings.focal and settings.focal * video.scale
    save_blendshapes(work, readings)
    track = _fitted(readings, canonical, video, given)
    readings, chosen = thinned(work, readings, settings.most)
    wandered = even_out(work, readings)
    if wandered:
        notes.append(
            f"exposure or white balance wander by {100 * wandered:.0f} %, which was evened out by "
            "the background: fix them in the camera's settings where you can"
        )
    track = _aligned(work, readings, track.part(chosen), rigid_landmarks(canonical.vertices))
    seen, moved = _save_mattes(work, readings, reached)
    if moved > MOVING:
        notes.append("the background moves: use a steady camera, or expect a blurred background")
    points = _points(work, readings, track, canonical)
    np.save(work / "points.npy", points)
    poses = track.poses()
    if settings.refine:
        try:
            found = refined(work, readings.frames, track, points, settings.device, reached)
            poses = found.poses
            console.print(
                f"poses refined by {found.turn:.2f}° and {1000 * found.shift:.1f} mm on average"
            )
        except Exception as error:  # of many kinds: drivers, compilers, memory
            reason = str(error).strip().split("\n")[0]
            notes.append(f"poses by landmarks only: refining failed ({reason or type(error)})")
    save_transforms(work, track.focal, track.center.tolist(), readings.frames, poses)
    sound = read_sound(video.path)
    if sound is None:
        notes.append("the video has no sound: speech cannot drive a head trained on it")
    else:
        _save_sound(work, sound)
    console.print(
        f"{len(readings.frames)} of {readings.total} frames tracked, focal length "
        f"{track.focal:.0f} px, reprojection error {reprojection_error(readings, track):.2f} px"
    )
    for note in notes:
        console.print(f"[yellow]warning:[/] {escape(str(video.path))}: {note}.")
    save_details(work, video, readings, track, settings, notes, seen)


def _fitted(
    readings: Readings, canonical: CanonicalFace, video: Video, focal: float | None
) -> rigid_head.Track:
    """The rigid head through all frames with a face, by landmarks."""
    landmarks = np.stack(readings.landmarks)[:, :MESH_LANDMARKS]
    start = np.stack(readings.poses)
    start[:, :3, 3] *= 0.01  # centimetres
    size = (video.width, video.height)
    with console.status("fitting head pose, head shape and focal length"):
        return smoothed(
            rigid_head.fit(landmarks, start, canonical.vertices, canonical.rigidity, size, focal)
        )


def _aligned(
    work: Path, readings: Readings, track: rigid_head.Track, rigid: np.ndarray
) -> rigid_head.Track:
    """The rigid head through some frames, corrected by the pictures."""

    def grey(index: int) -> np.ndarray:
        file = work / "ori_imgs" / f"{readings.frames[index]}.jpg"
        with open_picture(file, str(file)) as picture:
            return np.asarray(picture.convert("L"))

    with console.status("aligning the poses with the pictures"):
        return align(track, rigid, grey)


def _save_mattes(work: Path, readings: Readings, reached: Reached | None) -> tuple[float, float]:
    """Person, parts, clean plate, composites: share of background seen, and how much it moves."""
    landmarks = np.stack(readings.landmarks)
    models, colours = _learn(work, readings, landmarks)
    chosen = set(spread(len(readings.frames), SAMPLES))
    images, alphas = [], []
    count = len(readings.frames)
    steps = tracked(range(count), CUTOUTS, count, console, reached)
    for index in steps:
        number = readings.frames[index]
        image = load_uint8(work / "ori_imgs" / f"{number}.jpg")
        alpha = cutout.cut(image, landmarks[index], models)
        parts = parsing.parse(image, alpha, landmarks[index], colours)
        torso = alpha * parsing.is_class(parts, parsing.NECK, parsing.CLOTH)
        save_picture(work / "alpha" / f"{number}.png", (alpha * 255).round().astype(np.uint8))
        save_picture(work / "parsing" / f"{number}.png", parts)
        (work / "torso_imgs").mkdir(exist_ok=True)
        save_torso(work / "torso_imgs" / f"{number}.png", image, torso)
        if index in chosen:
            images.append(image)
            alphas.append(alpha)
    plate, seen = clean_plate(images, alphas)
    save_picture(work / "bc.jpg", plate)
    _save_composites(work, readings, load_uint8(work / "bc.jpg"))
    return seen, mismatch(plate, images, alphas)


def _learn(
    work: Path, readings: Readings, landmarks: np.ndarray
) -> tuple[cutout.Models, parsing.PartColours]:
    """Colours of background, person and parts, from a dozen frames."""
    chosen = spread(len(readings.frames), 12)
    whole = [load_uint8(work / "ori_imgs" / f"{readings.frames[i]}.jpg") for i in chosen]
    images = [cutout.working(image) for image in whole]
    faces = landmarks[chosen] * (images[0].shape[1] / whole[0].shape[1])
    with console.status("learning the colours of person and background"):
        models = cutout.learn(images, faces)
        alphas = [cutout.cut(*view, models) for view in zip(images, faces, strict=True)]
        return models, parsing.learn_colours(images, alphas, faces)


def _save_composites(work: Path, readings: Readings, plate: np.ndarray) -> None:
    """`gt_imgs`: the person before the clean plate."""
    for number in progress(readings.frames, "composing", console=console):
        image = load_uint8(work / "ori_imgs" / f"{number}.jpg")
        alpha = load_uint8(work / "alpha" / f"{number}.png")[..., None] / np.float32(255)
        mixed = image * alpha + plate * (1 - alpha)
        save_picture(work / "gt_imgs" / f"{number}.jpg", mixed.round().astype(np.uint8))


def _points(
    work: Path, readings: Readings, track: rigid_head.Track, canonical: CanonicalFace
) -> np.ndarray:
    """(P, 3): the face as tracked; hair, neck and chest as the middle pose shows them."""
    middle = spread_poses(track, 1)[0]
    parts = load_uint8(work / "parsing" / f"{readings.frames[middle]}.png")
    camera = camera_of(track, parts.shape[1], parts.shape[0])
    pose = track.poses()[middle]
    hair = parsing.is_class(parts, parsing.HAIR) > 0
    torso = parsing.is_class(parts, parsing.NECK, parsing.CLOTH) > 0
    points = [
        face_points(track.shape, canonical.triangles),
        silhouette_points(hair, camera, pose, (-0.03, 0.04), 4000),
        silhouette_points(torso, camera, pose, (-0.06, 0.0), 3000),
    ]
    return np.concatenate(points)


def _save_sound(work: Path, sound: Sound) -> None:
    """`aud.wav`, 16-bit."""
    import soundfile

    check_room(work, 2 * len(sound.samples))
    soundfile.write(work / "aud.wav", sound.samples, sound.rate, subtype="PCM_16")
