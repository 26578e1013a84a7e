"""Readers of recordings."""

import shutil
from pathlib import Path

from fuzz.reader import Reader
from fuzz.readers import samples
from ico3d.capture.formats import open_capture
from ico3d.capture.importing.recording import import_recording
from ico3d.capture.importing.settings import ImportSettings
from ico3d.capture.video import open_video, read_sound
from ico3d.rig.body_track import write_body_track
from support.recordings import (
    dna_files,
    films,
    foreign_models,
    multiview_folders,
    portrait_folder,
    renderme_files,
    synthetic_folder,
)

MOST_PICTURES = 50
"""Pictures that are taken of a film: a damaged one may claim that it lasts for years."""


def _video(folder: Path) -> None:
    for file in sorted(folder.iterdir()):
        video = open_video(file, 48)
        for number, _ in enumerate(video.frames(25.0)):
            if number == MOST_PICTURES:
                break
        read_sound(file)


def _capture(folder: Path) -> None:
    """Asks a capture for everything it can tell of its first frames."""
    capture = open_capture(_recording(folder))
    for camera in range(min(len(capture.cameras), 2)):
        capture.background(camera)
        for frame in range(min(capture.num_frames, 2)):
            if capture.has_image(camera, frame):
                capture.image(camera, frame)
            if capture.has_mask(camera, frame):
                capture.mask(camera, frame)
            capture.landmarks(camera, frame), capture.head_mask(camera, frame)
    for frame in range(min(capture.num_frames, 2)):
        capture.world_from_head(frame), capture.eyes(frame), capture.blendshapes(frame)
        capture.landmarks_3d(frame), capture.head_points(frame), capture.world_points(frame)
    capture.audio(), capture.provenance, capture.inspect(), getattr(capture, "phonemes", ())
    capture.body_track()


def _recording(folder: Path) -> Path:
    """A folder, or the file in it that stands for a recording."""
    files = [*folder.glob("*_raw.smc"), *folder.glob("0012_11.smc")]
    return files[0] if files else folder


def _import(folder: Path) -> None:
    out = folder.parent / "imported"
    shutil.rmtree(out, ignore_errors=True)
    import_recording(folder, out, ImportSettings())


def _tracked(folder: Path) -> None:
    """A multiview folder with tracks of head and body."""
    multiview_folders.write_folder(folder, 1, samples.FRAMES)
    samples.small_head_track(1).write(folder)
    write_body_track(samples.small_track(), folder)


def _portrait(folder: Path) -> None:
    portrait_folder.write_folder(folder)
    (folder / "ico3d.json").write_text('{"fps": 25.0, "provenance": {"consent": "given"}}')


def _colmap(binary: bool):
    return lambda folder: foreign_models.write_colmap(
        folder, foreign_models.poses(3), "OPENCV", binary
    )


def _transforms(folder: Path) -> None:
    names = ["a.png", "b.png"]
    foreign_models.write_pictures(folder, names)
    shown = foreign_models.frames(foreign_models.poses(2), names, time=0.5)
    foreign_models.write_transforms(folder, shown, k1=0.01)


def _dna(folder: Path) -> None:
    rig = dna_files.Rig(cameras=(0, 48), frames=2, sizes=((16, 12), (16, 12)))
    dna_files.write_recording(folder, rig)


def _renderme(folder: Path) -> None:
    rig = renderme_files.Rig(cameras=(22, 25), frames=2, size=(16, 12))
    renderme_files.write_recording(folder, rig)


CAPTURES = (
    Reader(
        "video",
        {
            kind: lambda folder, kind=kind: films.write_film(folder / f"film.{kind}")
            for kind in ("mp4", "mkv", "avi")
        },
        lambda: _video,
    ),
    Reader("portrait", {"portrait": _portrait}, lambda: _capture),
    Reader(
        "synthetic",
        {
            "head": synthetic_folder.write_synthetic,
            "body": lambda folder: synthetic_folder.write_synthetic(folder, "body"),
        },
        lambda: _capture,
    ),
    Reader(
        "multiview",
        {
            "pictures": lambda folder: multiview_folders.write_folder(folder, 2, 2),
            "films": samples.write_multiview_film,
        },
        lambda: _capture,
    ),
    Reader("tracks", {"tracks": _tracked}, lambda: _capture),
    Reader("DNA-Rendering", {"dna": _dna}, lambda: _capture),
    Reader("RenderMe-360", {"renderme": _renderme}, lambda: _capture),
    Reader("COLMAP", {"binary": _colmap(True), "text": _colmap(False)}, lambda: _import),
    Reader("transforms", {"transforms": _transforms}, lambda: _import),
)
