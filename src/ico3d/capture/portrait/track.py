"""Tracks a video of somebody talking and writes a capture in the talking-portrait layout."""

import json
import shutil
import tempfile
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image
from rich.console import Console
from rich.progress import track as progress
from scipy.ndimage import binary_dilation

from ico3d.capture.capture import Sound
from ico3d.capture.face.landmarks import MULTI_PIE
from ico3d.capture.face.mediapipe_face import (
    LANDMARKS,
    MESH_LANDMARKS,
    CanonicalFace,
    FaceReader,
    canonical_face,
)
from ico3d.capture.portrait import cutout, parsing, rigid_head
from ico3d.capture.portrait.files import (
    DETAILS,
    OPENGL_FROM_OPENCV,
    save_landmarks,
    save_picture,
    save_torso,
    save_transforms,
)
from ico3d.capture.portrait.picture_poses import align, rigid_landmarks, spread_poses
from ico3d.capture.portrait.plate import SAMPLES, clean_plate, mismatch
from ico3d.capture.surface.first_points import face_points, silhouette_points
from ico3d.capture.video import Video, open_video, read_sound
from ico3d.common.camera import Camera
from ico3d.common.device import DeviceName
from ico3d.common.people.stated import NOT_STATED
from ico3d.common.spread import spread
from ico3d.common.weights import model_file
from ico3d.errors import CaptureError

FPS = 25.0
MOVING = 0.04
"""Mean difference from the clean plate, 0 to 1, above which the camera must have moved."""
REFINED_SIZE = 256
"""Short side in pixels of the pictures by which poses are corrected."""
console = Console(stderr=True)


@dataclass(frozen=True)
class PortraitSettings:
    """How a video becomes a portrait capture.

    Attributes:
        size: Upper limit of the pictures' short side in pixels; larger videos are scaled down.
        focal: Focal length in pixels of the original video; None to estimate it.
        refine: Whether to correct the poses by pictures of the whole head.
        consent: What the person agreed to, and how.
        licence: Licence of the recording.
        device: Where to correct the poses.
        likeness: Whose likeness it is: the person's name.
    """

    size: int = 512
    focal: float | None = None
    refine: bool = True
    consent: str = NOT_STATED
    licence: str = NOT_STATED
    device: DeviceName = "auto"
    likeness: str = field(default=NOT_STATED, kw_only=True)


@dataclass
class Readings:
    """What MediaPipe's face model finds in a clip.

    Attributes:
        landmarks: (478, 2) pixels for each frame with a face.
        blendshapes: (52,) weights for each frame with a face.
        poses: (4, 4) rough head pose for each frame with a face, see `Face.pose`.
        frames: Numbers of the frames with a face.
        missing: Numbers of the frames without a face.
        names: Names of the blendshapes.
    """

    landmarks: list[np.ndarray] = field(default_factory=list)
    blendshapes: list[np.ndarray] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    missing: list[int] = field(default_factory=list)
    names: tuple[str, ...] = ()

    @property
    def total(self) -> int:
        """Number of all frames of the clip."""
        return len(self.frames) + len(self.missing)


def track_portrait(video: Path, out: Path, settings: PortraitSettings) -> None:
    """Tracks a video and writes the capture; `out` appears only once it is complete.

    Args:
        video: A video of one person by a fixed camera.
        out: Folder to make.
        settings: Size, focal length, and data for the avatar's manifest.

    Raises:
        CaptureError: If `out` exists, or the video cannot be read or shows no face.
        SettingsError: If CUDA is asked for and does not work.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face model is not installed.
    """
    if out.exists():
        raise CaptureError(f"{out} exists already: remove it or choose another folder.")
    model = model_file("face_landmarker.task", "tracking a portrait")
    opened = open_video(video, settings.size)
    if settings.refine:
        from ico3d.splat.device import computing_device

        computing_device(settings.device)  # better known now than after the tracking
    out.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}."))
    try:
        _write(work, opened, model, settings)
        work.chmod(0o755)
        work.rename(out)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    console.print(f"[green]capture written to {out}[/]; look at it: ico3d capture check {out}")


def _write(work: Path, video: Video, model: Path, settings: PortraitSettings) -> None:
    """Writes all files of the capture."""
    readings = _read_faces(work, video, model)
    notes = _notes(video, readings)
    canonical = canonical_face(model)
    given = settings.focal and settings.focal * video.scale
    track = _track(work, readings, canonical, video, given)
    _save_blendshapes(work, readings)
    seen, moved = _save_mattes(work, readings)
    if moved > MOVING:
        notes.append("the background moves: use a steady camera, or expect a blurred background")
    points = _points(work, readings, track, canonical)
    np.save(work / "points.npy", points)
    poses = track.poses()
    if settings.refine:
        try:
            poses = _refined(work, readings, track, points, settings.device)
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
        f"{track.focal:.0f} px, reprojection error {_reprojection_error(readings, track):.2f} px"
    )
    for note in notes:
        console.print(f"[yellow]warning:[/] {video.path}: {note}.")
    _save_details(work, video, readings, track, settings, notes, seen)


def _read_faces(work: Path, video: Video, model: Path) -> Readings:
    """Writes every picture and reads the face in it."""
    readings = Readings()
    total = round(video.announced / video.rate * FPS) if video.announced * video.rate else None
    with FaceReader(model) as reader:
        frames = progress(video.frames(FPS), "finding the face", total, console=console)
        for number, image in enumerate(frames):
            save_picture(work / "ori_imgs" / f"{number}.jpg", image)
            face = reader.read(image)
            if face is None:
                readings.missing.append(number)
                continue
            readings.frames.append(number)
            readings.landmarks.append(face.landmarks)
            readings.blendshapes.append(face.blendshapes)
            readings.poses.append(face.pose)
            save_landmarks(work / "ori_imgs" / f"{number}.lms", face.landmarks[MULTI_PIE])
        readings.names = reader.names
    if not readings.frames:
        raise CaptureError(
            f"{video.path}: no face in any of its {readings.total} frames; "
            "a portrait needs one person facing the camera."
        )
    return readings


def _notes(video: Video, readings: Readings) -> list[str]:
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


def _track(
    work: Path, readings: Readings, canonical: CanonicalFace, video: Video, focal: float | None
) -> rigid_head.Track:
    """The rigid head through all frames with a face: by landmarks, then by the pictures."""
    landmarks = np.stack(readings.landmarks)[:, :MESH_LANDMARKS]
    start = np.stack(readings.poses)
    start[:, :3, 3] *= 0.01  # centimetres
    size = (video.width, video.height)
    with console.status("fitting head pose, head shape and focal length"):
        found = rigid_head.fit(
            landmarks, start, canonical.vertices, canonical.rigidity, size, focal
        )

    def grey(index: int) -> np.ndarray:
        with Image.open(work / "ori_imgs" / f"{readings.frames[index]}.jpg") as picture:
            return np.asarray(picture.convert("L"))

    with console.status("aligning the poses with the pictures"):
        return align(found, rigid_landmarks(canonical.vertices), grey)


def _save_blendshapes(work: Path, readings: Readings) -> None:
    """`bs.npy`, a row per frame; frames without a face get what lies between their neighbours."""
    values = np.stack(readings.blendshapes)
    every = np.arange(readings.total)
    rows = [np.interp(every, readings.frames, column) for column in values.T]
    np.save(work / "bs.npy", np.stack(rows, 1).astype(np.float32))


def _save_mattes(work: Path, readings: Readings) -> tuple[float, float]:
    """Person, parts, clean plate, composites: share of background seen, and how much it moves."""
    landmarks = np.stack(readings.landmarks)
    models, colours = _learn(work, readings, landmarks)
    chosen = set(spread(len(readings.frames), SAMPLES))
    images, alphas = [], []
    steps = progress(range(len(readings.frames)), "cutting out the person", console=console)
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
    camera = _camera(track, parts.shape[1], parts.shape[0])
    pose = track.poses()[middle]
    hair = parsing.is_class(parts, parsing.HAIR) > 0
    torso = parsing.is_class(parts, parsing.NECK, parsing.CLOTH) > 0
    points = [
        face_points(track.shape, canonical.triangles),
        silhouette_points(hair, camera, pose, (-0.03, 0.04), 4000),
        silhouette_points(torso, camera, pose, (-0.06, 0.0), 3000),
    ]
    return np.concatenate(points)


def _camera(track: rigid_head.Track, width: int, height: int) -> Camera:
    """The camera that took the clip, for pictures scaled to this size."""
    scale = np.array([width, height]) / (2 * track.center)
    focal, center = track.focal * scale, track.center * scale
    lens = np.array([[focal[0], 0, center[0]], [0, focal[1], center[1]], [0, 0, 1]])
    return Camera(width, height, lens, OPENGL_FROM_OPENCV)


def _refined(
    work: Path, readings: Readings, track: rigid_head.Track, points: np.ndarray, device: DeviceName
) -> np.ndarray:
    """Poses (F, 4, 4) that the pictures agree with, hair and all."""
    from ico3d.capture.portrait.photometric_poses import Look, refine_poses

    plate = load_uint8(work / "bc.jpg")
    shrink = max(1, round(min(plate.shape[:2]) / REFINED_SIZE))
    size = (plate.shape[1] // shrink, plate.shape[0] // shrink)

    def small(image: np.ndarray) -> np.ndarray:
        resized = Image.fromarray(image).resize(size, Image.Resampling.BOX)
        return np.asarray(resized, np.float32) / 255

    @lru_cache(maxsize=1024)
    def look(index: int) -> Look:
        number = readings.frames[index]
        parts = load_uint8(work / "parsing" / f"{number}.png")
        head = parsing.is_class(parts, parsing.FACE, parsing.HAIR, parsing.MOUTH) > 0
        grown = binary_dilation(head, iterations=4)  # outlines tell most
        image = load_uint8(work / "gt_imgs" / f"{number}.jpg")
        return Look(small(image), small(grown.astype(np.uint8) * 255))

    camera = _camera(track, *size)
    refined = refine_poses(track.poses(), points, camera, small(plate), look, device)
    console.print(
        f"poses refined by {refined.turn:.2f}° and {1000 * refined.shift:.1f} mm on average"
    )
    return refined.poses


def _save_sound(work: Path, sound: Sound) -> None:
    """`aud.wav`, 16-bit."""
    import soundfile

    soundfile.write(work / "aud.wav", sound.samples, sound.rate, subtype="PCM_16")


def _save_details(
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
        "size": [video.width, video.height],
        "blendshape_names": list(readings.names),
        "tracker": {
            "model": f"MediaPipe face landmarker, {LANDMARKS} landmarks",
            "focal": "given" if settings.focal else "estimated",
            "focal_px": track.focal,
            "reprojection_px": _reprojection_error(readings, track),
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


def _reprojection_error(readings: Readings, track: rigid_head.Track) -> float:
    """Root mean square distance in pixels of the steadiest quarter of the landmarks."""
    error = np.stack(readings.landmarks)[:, :MESH_LANDMARKS] - track.project()
    steady = track.sigmas <= np.quantile(track.sigmas, 0.25)
    return float(np.sqrt((error[:, steady] ** 2).sum(-1).mean()))


def load_uint8(path: Path) -> np.ndarray:
    """A picture as uint8."""
    with Image.open(path) as picture:
        return np.asarray(picture)
