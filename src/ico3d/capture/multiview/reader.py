"""Reads a multiview folder (docs/captures/multiview.md)."""

import copy
import os
from pathlib import Path

import numpy as np

from ico3d.capture.box import Box
from ico3d.capture.capture import RecordedCapture, Sound, all_frames, last_eleventh
from ico3d.capture.decoding import to_bytes, unit
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.finding import Finding, missing_and_damaged
from ico3d.capture.headpose.track_file import read_track
from ico3d.capture.lens import Lens
from ico3d.capture.multiview.description import read_description
from ico3d.capture.multiview.files import RecordedFiles
from ico3d.capture.reading.arrays import read_numbers
from ico3d.capture.sound import read_sound_file
from ico3d.capture.surface.head import head_hull
from ico3d.capture.vetting.claims import check_claimed
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError


class MultiviewCapture(RecordedCapture):
    """A recording by several fixed, synchronised cameras.

    Pictures, masks and plates are undistorted. The transparency of an RGBA picture is its mask; the
    picture is shown on black.
    """

    kind = "multiview"

    def __init__(self, path: Path):
        """Opens a folder; pictures are read when asked for.

        Raises:
            CaptureError: If `cameras.json` is damaged or claims far more frames than there are
                pictures, or a camera has none.
        """
        self.path = path
        self._about = read_description(path)
        self.fps, self.num_frames = self._about.fps, self._about.num_frames
        self.lenses: list[Lens] = [place.lens for place in self._about.places]
        self.files = RecordedFiles(path, self.lenses)
        counts = map(self.files.count, range(len(self.lenses)))
        check_claimed(self.num_frames, counts, str(path))
        self.cameras = tuple(
            Camera(
                place.lens.width,
                place.lens.height,
                place.lens.straight_intrinsics,
                place.world_to_camera,
                place.lens.name,
            )
            for place in self._about.places
        )
        self.shows = "head" if self._about.shows == "head" else "body"
        self.split = (
            last_eleventh(self.num_frames)
            if self.shows == "head"
            else all_frames(self.num_frames, self.cameras)
        )
        self._track = read_track(path, self.num_frames, len(self.cameras))
        self.blendshape_names = None if self._track is None else BLENDSHAPES

    def apart(self) -> "MultiviewCapture":
        """The same recording with open videos of its own, for another thread.

        Nothing is read again: with many cameras that would take long, once for each of them.
        """
        other = copy.copy(self)
        other.files = self.files.apart()
        return other

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether there is a file of the picture, or a video that is long enough."""
        return self.files.has_picture(camera, self._index(frame))

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether there is a file of the mask, or a picture with opacity."""
        return self.files.has_mask(camera, self._index(frame))

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The undistorted picture, uint8, or None if missing."""
        picture = self.files.picture(camera, self._index(frame))
        if picture is None:
            return None
        straight = self.lenses[camera].straightened(picture, box)
        if picture.shape[-1] < 4:
            return straight
        return to_bytes(unit(straight[..., :3]) * unit(straight[..., 3:]))

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The undistorted mask, uint8, else the picture's opacity, else None."""
        mask = self.files.mask(camera, self._index(frame))
        if mask is None and self.files.clip(camera) is None:
            picture = self.files.picture(camera, frame)
            mask = None if picture is None or picture.shape[-1] < 4 else picture[..., 3]
        return None if mask is None else self.lenses[camera].straightened(mask, box)

    def background(self, camera: int) -> np.ndarray | None:
        """The undistorted clean plate, or None if missing."""
        plate = self.files.plate(camera)
        return None if plate is None else unit(self.lenses[camera].straightened(plate))

    def audio(self) -> Sound | None:
        """The sound of `audio.wav`, or None if missing."""
        return read_sound_file(self.path / "audio.wav")

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """Head pose (4, 4) from `ico3d capture track`; None where that has not run."""
        return None if self._track is None else self._track.world_from_head[self._index(frame)]

    def eyes(self, frame: int) -> np.ndarray | None:
        """(7,) eye and brow values from `ico3d capture track`; None where that has not run."""
        return None if self._track is None else self._track.eyes[self._index(frame)]

    def blendshapes(self, frame: int) -> np.ndarray | None:
        """(52,) blendshapes from `ico3d capture track`; None where that has not run."""
        return None if self._track is None else self._track.blendshapes[self._index(frame)]

    def landmarks_3d(self, frame: int) -> np.ndarray | None:
        """(68, 3) landmarks in canonical head space, metres; None where no head was tracked."""
        return None if self._track is None else self._track.landmarks[self._index(frame)]

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) tracked landmarks in pixels of a camera, even of one that sees no face."""
        if self._track is None:
            return None
        seen = self.cameras[camera].moved(self._track.world_from_head[self._index(frame)])
        return seen.project(self._track.landmarks[frame])[0]

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) of heads, the points of `points/FRAME.npy`, else the visual hull; else None.

        Raises:
            CaptureError: If the file of points is damaged.
        """
        if self.shows == "body":
            return None
        points = self._points(frame)
        return head_hull(self, frame) if points is None else points

    def world_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) of bodies, the points of `points/FRAME.npy`; else None.

        Raises:
            CaptureError: If the file of points is damaged.
        """
        return self._points(frame) if self.shows == "body" else None

    def _points(self, frame: int) -> np.ndarray | None:
        """(P, 3) the file's points, in the space that the folder's kind decides."""
        file = self.path / "points" / f"{self._index(frame):06d}.npy"
        if not os.path.isfile(file):
            return None
        points = read_numbers(file)
        if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind != "f":
            raise CaptureError(f"{file} must hold (P, 3) floating-point numbers.")
        if not np.isfinite(points).all():
            raise CaptureError(f"{file} holds NaN or infinity.")
        return points

    @property
    def provenance(self) -> dict:
        """Sources, likeness, consent and licence from `cameras.json`."""
        return {
            "kind": self.kind,
            "sources": list(self._about.sources),
            "likeness": self._about.likeness,
            "consent": self._about.consent,
            "licence": self._about.licence,
        }

    def inspect(self) -> list[Finding]:
        """Missing or damaged pictures and masks, and videos that are too short."""
        findings = [self._inspect_pictures()]
        if os.path.isdir(self.path / "masks"):
            findings.append(self._inspect_masks())
        elif os.path.isdir(self.path / "backgrounds"):
            text = f"none yet: ico3d capture masks {self.path} makes them from the clean plates"
            findings.append(Finding("mask files", "warn", text))
        if self._track is not None:
            findings.append(self._track.finding())
        return findings

    def _inspect_pictures(self) -> Finding:
        """Whether every camera has every frame."""
        missing, damaged = _Missing(), list[tuple[str, int]]()
        for camera, lens in enumerate(self.lenses):
            clip = self.files.clip(camera)
            if clip is not None:
                missing.add(lens.name, clip.count, self.num_frames - clip.count)
                continue
            listed = self.files.listed("images", camera, self.num_frames)
            missing.add(lens.name, _gap(listed), self.num_frames - len(listed))
            damaged += self._damaged("images", camera, listed)
        total = len(self.lenses) * self.num_frames
        return missing_and_damaged("views", total, missing.first, damaged, missing.further)

    def _inspect_masks(self) -> Finding:
        """Whether every picture has a mask."""
        missing, damaged, total = _Missing(), list[tuple[str, int]](), 0
        for camera, lens in enumerate(self.lenses):
            clip = self.files.clip(camera)
            masks = self.files.listed("masks", camera, self.num_frames)
            if clip is None:
                pictures = self.files.listed("images", camera, self.num_frames)
                absent, wanted = pictures - masks, len(pictures)
                missing.add(lens.name, min(absent, default=0), len(absent))
            else:
                pictures, wanted = {n for n in masks if n < clip.count}, clip.count
                missing.add(lens.name, _gap(pictures), wanted - len(pictures))
            total += wanted
            damaged += self._damaged("masks", camera, pictures & masks)
        return missing_and_damaged("mask files", total, missing.first, damaged, missing.further)

    def _damaged(self, kind: str, camera: int, frames: set[int]) -> list[tuple[str, int]]:
        """Camera and frame of files that are no pictures of this camera."""
        name = self.lenses[camera].name
        return [(name, n) for n in sorted(frames) if self.files.is_damaged(kind, camera, n)]

    def _index(self, frame: int) -> int:
        if not 0 <= frame < self.num_frames:
            raise CaptureError(f"{self.path} has frames 0 to {self.num_frames - 1}, not {frame}.")
        return frame


class _Missing:
    """The first missing file, and how many more: a folder may claim millions of frames."""

    def __init__(self):
        """Starts with none."""
        self.first: list[tuple[str, int]] = []
        self.further = 0

    def add(self, camera: str, frame: int, count: int) -> None:
        """Adds files of a camera, of which that of a frame is the first."""
        if count > 0 and not self.first:
            self.first.append((camera, frame))
            count -= 1
        self.further += max(count, 0)


def _gap(frames: set[int]) -> int:
    """The lowest number that is not there."""
    return next(n for n in range(len(frames) + 1) if n not in frames)
