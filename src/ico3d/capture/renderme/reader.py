"""Reads a recording of the RenderMe-360 data set: `docs/captures/renderme.md`."""

import logging
import math
from functools import cached_property
from itertools import islice, product
from pathlib import Path

import numpy as np

from ico3d.capture.box import Box
from ico3d.capture.capture import Sound, last_eleventh
from ico3d.capture.decoding import largest_channel
from ico3d.capture.finding import Finding
from ico3d.capture.renderme.calibration import frame_rate, read_cameras
from ico3d.capture.renderme.examine import examine_files, mask_folder
from ico3d.capture.renderme.files import find_files
from ico3d.capture.renderme.flame import FlameFit, FlameFits
from ico3d.capture.renderme.landmarks import MULTI_PIE, POINTS, in_known_order, in_space
from ico3d.capture.smc.file import SmcFile
from ico3d.capture.smc.reader import SmcCapture, count_frames
from ico3d.capture.sound import check_claim, mono
from ico3d.capture.surface.head import head_hull
from ico3d.common.sound import Claim
from ico3d.errors import CaptureError

log = logging.getLogger(__name__)
SOUND = "Camera/00/audio"
LOUDEST = 1.01
JUDGED = 8
"""Number of sets of landmarks by which their order is checked."""
HEAD_RADIUS = 0.25
"""Radius in metres around the head within which its surface is searched."""


class RenderMe360(SmcCapture):
    """One part of RenderMe-360: up to 60 cameras around a head.

    Pictures and masks are undistorted. Head poses come from FLAME fits where there are any,
    otherwise from landmarks that several cameras see.
    """

    kind = "renderme-360"

    def __init__(self, path: Path):
        """Opens the files and reads the calibration; pictures are read when asked for.

        Args:
            path: The raw file, or a folder that holds one recording.

        Raises:
            CaptureError: If a file is missing or damaged, or the folder holds several recordings.
            MissingExtraError: If h5py or OpenCV is not installed.
        """
        files = find_files(path)
        self._name = files.name
        self._raw = SmcFile(files.raw)
        known = (files.annotations,) if files.annotations else ()
        self._files = (*(SmcFile(file) for file in known), self._raw)
        if not any(file.holds("Calibration") for file in self._files):
            raise CaptureError(
                f"{files.raw} lacks its annotations with the calibration: "
                f"put {files.name}_anno.smc beside it."
            )
        self._devices, lost = read_cameras(self._raw, self._holding("Calibration"))
        if lost:
            log.warning("%s: cameras without calibration left out: %s", path, ", ".join(lost))
        count = count_frames(self._raw, ["Camera"], [d.pictures for d in self._devices])
        super().__init__(files.raw, self._devices, count)
        self.fps = frame_rate(files.part, self._devices, count, self._seconds())
        self.split = last_eleventh(count)
        self.flame_fits = FlameFits(self._holding("FLAME"), count, self.upright)

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether the raw file holds the picture."""
        return self._raw.lists(f"{self._devices[camera].pictures}/{self.index(frame)}")

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether a file of the recording holds a mask."""
        folder = mask_folder(self._devices[camera].name)
        return self._holding(folder).lists(f"{folder}/{self.index(frame)}")

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The undistorted picture, uint8, or None if missing."""
        device = self._devices[camera]
        picture = self.decoded(self._raw, device, f"{device.pictures}/{self.index(frame)}")
        return None if picture is None else device.lens.straightened(picture, box)

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The undistorted mask, uint8, soft along hair; None if missing."""
        device = self._devices[camera]
        folder = mask_folder(device.name)
        picture = self.decoded(self._holding(folder), device, f"{folder}/{self.index(frame)}")
        if picture is None:
            return None
        return device.lens.straightened(largest_channel(picture), box)

    def audio(self) -> Sound | None:
        """The whole sound, mono at 16 kHz; only parts with speech have one.

        Raises:
            CaptureError: If the sound is damaged.
        """
        file = self._holding(SOUND)
        shape, rate = file.shape(f"{SOUND}/audio"), self._sample_rate()
        if not shape or rate is None:
            return None
        check_claim(file.path, Claim(rate, math.prod(shape[1:]), shape[0]))
        samples = file.numbers(f"{SOUND}/audio", None)
        if samples is None:
            return None
        loudest = max(samples.max(initial=0.0), -samples.min(initial=0.0))
        if samples.ndim > 2 or loudest > LOUDEST:
            raise CaptureError(f"{file.path}: {SOUND}/audio is no sound between -1 and 1.")
        np.clip(samples, -1, 1, out=samples)
        return mono(samples.astype(np.float32), rate)

    def flame(self, frame: int) -> FlameFit | None:
        """FLAME parameters and vertices of a frame, or None."""
        return self.flame_fits.at(self.index(frame))

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """Head pose (4, 4) from the FLAME fit, else from 3D landmarks, else None."""
        if self.flame_fits.frames:
            return self.flame_fits.pose(self.index(frame))
        return super().world_from_head(frame)

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) pixels: landmarks of the files, else projected 3D landmarks, else None."""
        own = self._landmarks_in(camera, self.index(frame)) if self._ordered else None
        return super().landmarks(camera, frame) if own is None else own

    def keypoints_2d(self, camera: int, frame: int) -> np.ndarray | None:
        """(106, 2) pixels of the undistorted picture; None if the face was not found.

        Raises:
            CaptureError: If the landmarks are damaged.
        """
        lens, name = self._devices[camera].lens, self._devices[camera].name
        inside = f"Keypoints2d/{name}/{self.index(frame)}"
        file = self._holding("Keypoints2d")
        found = file.numbers(inside, None, holes=True)
        if found is None or not found.size:
            return None
        if found.shape != (POINTS, 2):
            raise CaptureError(
                f"{file.path}: {inside} has shape {found.shape}, expected {POINTS} x 2."
            )
        return lens.straightened_points(found + 0.5)

    def keypoints_3d(self, frame: int) -> np.ndarray | None:
        """(73, 3) in the capture's world, metres, in the order of the files; None if missing."""
        inside = f"Keypoints3d/{self.index(frame)}"
        found = self._holding("Keypoints3d").numbers(inside, None, holes=True)
        return None if found is None or not found.size else found.reshape(-1, 3) @ self.upright.T

    def face_points(self) -> np.ndarray | None:
        """(F, 68, 3) landmarks in the world, triangulated from all cameras, metres; or None."""
        if len(self._face_cameras) < 2 or not self._ordered:
            return None
        return np.stack([self._in_space(frame) for frame in range(self.num_frames)])

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) in head space: FLAME's vertices, else the visual hull of the masks, else None."""
        pose, vertices = self.world_from_head(frame), self.flame_fits.vertices(frame)
        if pose is None:
            return None
        inside = None if vertices is None else (vertices - pose[:3, 3]) @ pose[:3, :3]  # (P, 3)
        surface = head_hull(self, frame) if inside is None else inside
        return None if surface is None else surface[np.linalg.norm(surface, axis=1) < HEAD_RADIUS]

    @property
    def provenance(self) -> dict:
        """The data set, and the licence that its users have signed."""
        return {
            "kind": self.kind,
            "sources": [f"RenderMe-360 (NeurIPS 2023), recording {self._name}"],
            "likeness": f"the person of RenderMe-360 {self._name}",
            "consent": "given to the makers of RenderMe-360",
            "licence": "RenderMe-360 licence agreement",
        }

    def inspect(self) -> list[Finding]:
        """Missing or damaged pictures and annotations."""
        masks = self._holding(mask_folder(self._devices[0].name))
        track = self.head_motion
        found = 0 if track is None else int(np.isfinite(track.points).all((1, 2)).sum())
        fitted = len(self.flame_fits.frames)
        return examine_files(self._raw, masks, self._devices, self.num_frames, fitted, found)

    @cached_property
    def _ordered(self) -> bool:
        """Whether the landmarks are in the order that is known here."""
        views = product(range(self.num_frames), self._face_cameras)
        faces = (self._landmarks_in(camera, frame) for frame, camera in views)
        judged = [in_known_order(f) for f in islice((f for f in faces if f is not None), JUDGED)]
        ordered = 2 * sum(judged) >= len(judged)
        if not ordered:
            log.warning("%s: landmarks in an order not known here are left out.", self.path)
        return ordered

    @cached_property
    def _face_cameras(self) -> list[int]:
        """Cameras that have landmarks of any frame."""
        file = self._holding("Keypoints2d")
        names = [device.name for device in self._devices]
        return [c for c, name in enumerate(names) if file.keys(f"Keypoints2d/{name}")]

    def _landmarks_in(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) of the files, or None where the face was not found."""
        points = self.keypoints_2d(camera, frame)
        return None if points is None else points[MULTI_PIE]

    def _in_space(self, frame: int) -> np.ndarray:
        """(68, 3) in the world; NaN where not found."""
        found = {camera: self._landmarks_in(camera, frame) for camera in self._face_cameras}
        seen = {camera: marks for camera, marks in found.items() if marks is not None}
        pixels = np.array(list(seen.values())).reshape(-1, len(MULTI_PIE), 2)  # (C, 68, 2)
        return in_space([self.cameras[camera] for camera in seen], pixels)

    def _seconds(self) -> float | None:
        """Length of the sound."""
        shape, rate = self._holding(SOUND).shape(f"{SOUND}/audio"), self._sample_rate()
        return shape[0] / rate if shape and rate else None

    def _sample_rate(self) -> int | None:
        """Samples per second of the sound."""
        file = self._holding(SOUND)
        rate = file.numbers(f"{SOUND}/sample_rate", None)
        if rate is None:
            return None
        if rate.size != 1 or not 1000 <= rate.item() <= 400_000:
            raise CaptureError(f"{file.path}: {SOUND}/sample_rate is no sample rate.")
        return round(rate.item())

    def _holding(self, group: str) -> SmcFile:
        """The file with a group; the last where none has it."""
        return next((file for file in self._files if file.holds(group)), self._files[-1])
