"""The files of a multiview folder: pictures as recorded, with lens distortion."""

import copy
import os
import re
from pathlib import Path

import numpy as np

from ico3d.capture.decoding import decoded, has_opacity, largest_channel, size_of
from ico3d.capture.lens import Lens
from ico3d.capture.multiview.clip import Clip, OpenClips
from ico3d.errors import CaptureError

PICTURES = (".png", ".jpg", ".jpeg")
_FRAME = re.compile(r"(\d{6,8})\.(?:png|jpe?g)")
VIDEOS = (".mp4", ".mkv", ".mov", ".webm", ".avi")


class RecordedFiles:
    """Pictures, masks and clean plates of all cameras of a multiview folder."""

    def __init__(self, folder: Path, lenses: list[Lens]):
        """Finds out which cameras have pictures and which have videos.

        Raises:
            CaptureError: If a camera has neither.
        """
        self.folder, self._lenses = folder, lenses
        self._clips = [self._find_clip(lens.name) for lens in lenses]
        self._open = OpenClips()

    def apart(self) -> "RecordedFiles":
        """The same files with open videos of their own, for another thread."""
        other = copy.copy(self)
        other._clips = [clip and clip.apart() for clip in self._clips]
        other._open = OpenClips()
        return other

    def clip(self, camera: int) -> Clip | None:
        """The video of a camera, or None for a camera with single pictures."""
        return self._clips[camera]

    def count(self, camera: int) -> int:
        """Number of pictures of a camera; of files, those whose names are numbers of frames.

        Raises:
            CaptureError: If the camera's video cannot be read.
        """
        clip = self._clips[camera]
        return len(self._numbered("images", camera)) if clip is None else clip.count

    def has_picture(self, camera: int, frame: int) -> bool:
        """Whether `picture` would return one; nothing is decoded."""
        clip = self._clips[camera]
        if clip is None:
            return self.file("images", camera, frame) is not None
        return frame < clip.count

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether there is a mask, or a picture with opacity; nothing is decoded.

        Raises:
            CaptureError: If the header of the picture is damaged.
        """
        if self.file("masks", camera, frame) is not None:
            return True
        file = self.file("images", camera, frame) if self._clips[camera] is None else None
        return file is not None and has_opacity(file, self._named(file, camera, frame))

    def picture(self, camera: int, frame: int) -> np.ndarray | None:
        """uint8 RGB or RGBA (H, W, C), or None if missing."""
        clip = self._clips[camera]
        if clip is None:
            return self._decoded("images", camera, frame)
        picture = self._open.picture(clip, frame)
        if picture is not None:
            self._check_size(picture, camera, f"{clip.path}: frame {frame}")
        return picture

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """uint8 (H, W) largest channel of the mask picture, or None if missing."""
        picture = self._decoded("masks", camera, frame)
        return None if picture is None else largest_channel(picture)

    def plate(self, camera: int) -> np.ndarray | None:
        """uint8 RGB (H, W, 3) clean plate, or None if missing."""
        name = self._lenses[camera].name
        file = _existing(self.folder / "backgrounds", name)
        if file is None:
            return None
        what = f"{file} (the background of camera {name})"
        picture = decoded(file, what)[..., :3]
        self._check_size(picture, camera, what)
        return picture

    def file(self, kind: str, camera: int, frame: int) -> Path | None:
        """Path of a picture (kind "images") or a mask (kind "masks"), or None if missing."""
        return _existing(self.folder / kind / self._lenses[camera].name, f"{frame:06d}")

    def listed(self, kind: str, camera: int, frames: int) -> set[int]:
        """Numbers of the frames that have a file as `file` finds it; the folder is read once.

        Args:
            kind: "images" or "masks".
            camera: The camera.
            frames: Numbers from here on are left out.
        """
        found = self._numbered(kind, camera)
        return {n for n in found if n < frames and self.file(kind, camera, n) is not None}

    def is_damaged(self, kind: str, camera: int, frame: int) -> bool:
        """Whether the first bytes of an existing file show that it is no picture of this camera."""
        file, lens = self.file(kind, camera, frame), self._lenses[camera]
        try:
            return file is not None and size_of(file, "") != (lens.width, lens.height)
        except CaptureError:
            return True

    def _numbered(self, kind: str, camera: int) -> set[int]:
        """Numbers of frames that are names in the folder of a camera; it is read once."""
        try:
            with os.scandir(self.folder / kind / self._lenses[camera].name) as entries:
                return {int(m[1]) for e in entries if (m := _FRAME.fullmatch(e.name))}
        except OSError:
            return set()

    def _find_clip(self, name: str) -> Clip | None:
        """The video of a camera unless it has pictures."""
        if os.path.isdir(self.folder / "images" / name):
            return None
        videos = (self.folder / "videos" / f"{name}{suffix}" for suffix in VIDEOS)
        video = next((path for path in videos if os.path.isfile(path)), None)
        if video is None:
            raise CaptureError(
                f"{self.folder}: camera {name} has neither videos/{name}.mp4 nor images/{name}."
            )
        return Clip(video)

    def _decoded(self, kind: str, camera: int, frame: int) -> np.ndarray | None:
        """A picture file."""
        file = self.file(kind, camera, frame)
        if file is None:
            return None
        what = self._named(file, camera, frame)
        picture = decoded(file, what)
        self._check_size(picture, camera, what)
        return picture

    def _named(self, file: Path, camera: int, frame: int) -> str:
        """Names a picture in errors."""
        return f"{file} (camera {self._lenses[camera].name}, frame {frame})"

    def _check_size(self, picture: np.ndarray, camera: int, what: str) -> None:
        """A picture must be of its camera's size."""
        height, width = picture.shape[:2]
        lens = self._lenses[camera]
        if (width, height) != (lens.width, lens.height):
            raise CaptureError(
                f"{what} has {width}x{height} pixels, its camera {lens.width}x{lens.height}."
            )


def _existing(folder: Path, stem: str) -> Path | None:
    """The picture file of a name."""
    paths = (folder / f"{stem}{suffix}" for suffix in PICTURES)
    return next((path for path in paths if os.path.isfile(path)), None)
