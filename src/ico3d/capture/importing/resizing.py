"""Writes any capture again with smaller pictures, as a multiview folder."""

from pathlib import Path

import numpy as np

from ico3d.capture.decoding import to_bytes
from ico3d.capture.formats import open_capture, opened_apart
from ico3d.capture.headpose.track_file import read_track
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.lens import Lens
from ico3d.capture.multiview.description import Description, Place
from ico3d.capture.multiview.parallel import View, each_camera
from ico3d.capture.portrait.files import save_picture
from ico3d.capture.writing.new_folder import check_room, new_folder
from ico3d.common.camera import Camera
from ico3d.rig.body_track import write_body_track


def resize_capture(source: Path, out: Path, height: int, workers: int) -> Description:
    """Writes pictures, masks, clean plates, sound and surface points into a multiview folder.

    The folder appears only once it is complete.

    Args:
        source: A capture of any format.
        out: Folder to make.
        height: Upper limit of the pictures' height in pixels.
        workers: Number of threads.

    Returns:
        The contents of the new `cameras.json`.

    Raises:
        CaptureError: If `out` exists, or the capture cannot be read.
    """
    whole = open_capture(source)
    capture = ResizedCapture(whole, height)
    known = capture.provenance
    about = Description(
        capture.fps,
        capture.num_frames,
        tuple(_place(camera) for camera in capture.cameras),
        tuple(known["sources"]),
        known["consent"],
        known["licence"],
        capture.shows,
        known["likeness"],
    )
    cameras = range(len(capture.cameras))
    with new_folder(out, about.likeness, about.sources) as work:

        def start(camera: int) -> View:
            opened = ResizedCapture(opened_apart(whole), height)
            return lambda frame: _write_view(opened, work, camera, frame)

        each_camera(start, cameras, capture.num_frames, workers, "pictures")
        _write_rest(capture, work)
        about.write(work)
    return about


def _place(camera: Camera) -> Place:
    """A camera without distortion."""
    lens = Lens(camera.name, camera.width, camera.height, camera.intrinsics)
    return Place(lens, camera.world_to_camera)


def _write_view(capture: ResizedCapture, work: Path, camera: int, frame: int) -> int:
    """Writes one picture and its mask in the new size."""
    image = capture.image(camera, frame)
    if image is None:
        return 0
    name = capture.cameras[camera].name
    save_picture(work / "images" / name / f"{frame:06d}.jpg", to_bytes(image))
    mask = capture.mask(camera, frame)
    if mask is not None:
        save_picture(work / "masks" / name / f"{frame:06d}.png", to_bytes(mask))
    return 1


def _write_rest(capture: ResizedCapture, work: Path) -> None:
    """Writes what belongs to no single picture: plates, sound, points, head and body tracks."""
    import soundfile

    for index, camera in enumerate(capture.cameras):
        (work / "images" / camera.name).mkdir(parents=True, exist_ok=True)
        plate = capture.background(index)
        if plate is not None:
            save_picture(work / "backgrounds" / f"{camera.name}.png", to_bytes(plate))
    sound = capture.audio()
    if sound is not None:
        check_room(work, 2 * len(sound.samples))  # 16 bits each
        soundfile.write(work / "audio.wav", sound.samples, sound.rate)
    _write_tracks(capture, work)
    if capture.shows == "head":
        return  # a head: its points lie in its own head space, tracking will find another
    for frame in range(capture.num_frames):
        points = capture.world_points(frame)
        if points is not None:
            check_room(work, points.size * np.dtype(np.float32).itemsize)
            (work / "points").mkdir(exist_ok=True)
            np.save(work / "points" / f"{frame:06d}.npy", points.astype(np.float32))


def _write_tracks(capture: ResizedCapture, work: Path) -> None:
    """Writes head and body tracks, which are in metres, whatever the size of the pictures.

    They are read and written anew: a file in somebody's folder may be a hole, or a link to another.
    """
    head = read_track(capture.path, capture.num_frames, len(capture.cameras))
    if head is not None:
        head.write(work)
    body = capture.body_track()
    if body is not None:
        write_body_track(body, work)
