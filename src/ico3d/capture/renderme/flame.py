"""FLAME fits of a RenderMe-360 recording, and head poses that follow from them.

The FLAME model itself is not needed, because the files contain its vertices. These lack the fit's
translation: world = verts + cam[1:4]. FLAME's neck joint turns the head relative to the root, so
the head pose is computed from the vertices: the mean upper head is fitted rigidly to each frame.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.capture.headpose.procrustes import fit_poses, procrustes
from ico3d.capture.smc.file import SmcFile
from ico3d.common.spread import spread
from ico3d.errors import CaptureError

VERTICES = 5023
UPPER = 0.7
"""Vertices above this share of the mesh's height form the upper head: eyes, forehead and skull."""
MEASURED = 24
"""Number of frames in which the steadiness of each vertex is measured."""


@dataclass(frozen=True)
class FlameFit:
    """The FLAME model fitted to one frame.

    Attributes:
        global_pose: (3,) axis-angle rotation of the whole model, in the world of the files.
        neck_pose: (3,) axis-angle rotation of the head relative to the whole model.
        jaw_pose: (3,) axis-angle rotation of the jaw.
        eye_poses: (2, 3) axis-angle rotations of the left and the right eye.
        shape: (100,) shape parameters.
        expression: (50,) expression parameters.
        vertices: (5023, 3) metres in the capture's world.
    """

    global_pose: np.ndarray
    neck_pose: np.ndarray
    jaw_pose: np.ndarray
    eye_poses: np.ndarray
    shape: np.ndarray
    expression: np.ndarray
    vertices: np.ndarray


@dataclass(frozen=True)
class Skull:
    """The rigid part of the FLAME mesh.

    Attributes:
        chosen: (M,) indices of the vertices.
        points: (M, 3) positions in canonical head space, metres.
        weights: (M,) weights by steadiness.
    """

    chosen: np.ndarray
    points: np.ndarray
    weights: np.ndarray


class FlameFits:
    """FLAME fits of all frames, read one at a time."""

    def __init__(self, file: SmcFile, num_frames: int, upright: np.ndarray):
        """Lists the frames that have a fit.

        Args:
            file: The file with the group FLAME.
            num_frames: Number of frames of the recording.
            upright: (3, 3) rotation from the world of the files to the capture's world.

        Raises:
            CaptureError: If the file is damaged.
        """
        self._file, self._upright = file, upright
        found = file.numbered("FLAME")
        self.frames: tuple[int, ...] = tuple(frame for frame in found if frame < num_frames)

    def at(self, frame: int) -> FlameFit | None:
        """The fit of a frame, or None.

        Raises:
            CaptureError: If an array is missing or damaged.
        """
        vertices = self.vertices(frame)
        if vertices is None:
            return None
        eyes = [self._part(frame, f"{side}_eye_pose", 3) for side in ("left", "right")]
        return FlameFit(
            self._part(frame, "global_pose", 3),
            self._part(frame, "neck_pose", 3),
            self._part(frame, "jaw_pose", 3),
            np.stack(eyes),
            self._part(frame, "shape", 100),
            self._part(frame, "exp", 50),
            vertices,
        )

    def vertices(self, frame: int) -> np.ndarray | None:
        """(5023, 3) vertices in the capture's world, metres; None without a fit.

        Raises:
            CaptureError: If an array is missing or damaged.
        """
        if frame not in self.frames:
            return None
        vertices = self._part(frame, "verts", VERTICES * 3).reshape(VERTICES, 3)
        translation = self._part(frame, "cam", None)[1:4]
        if len(translation) != 3:
            raise CaptureError(f"{self._file.path}: FLAME/{frame}/cam has no translation.")
        return (vertices + translation) @ self._upright.T

    def pose(self, frame: int) -> np.ndarray | None:
        """Head pose (4, 4), canonical head space to world; None without a fit."""
        vertices = self.vertices(frame)
        if vertices is None:
            return None
        skull = self._skull
        return fit_poses(skull.points, vertices[None, skull.chosen], skull.weights[None])[0]

    @cached_property
    def _skull(self) -> Skull:
        """The mean skull of frames spread over the recording.

        Its axes are the model's in the first of them (+x to the person's left, +y up, +z forward),
        its origin is the middle of its vertices.
        """
        frames = [self.frames[index] for index in spread(len(self.frames), MEASURED)]
        meshes = np.stack([self.vertices(frame) for frame in frames])  # type: ignore[arg-type]
        axes = self._axes(frames[0])
        heights = meshes[0] @ axes[:, 1]  # (V,)
        chosen = np.flatnonzero(heights > heights.min() + UPPER * np.ptp(heights))
        motion = procrustes(meshes[:, chosen], np.ones(len(chosen), bool))
        frame = np.eye(4)
        frame[:3, :3] = motion.poses[0, :3, :3].T @ axes
        frame[:3, 3] = motion.shape.mean(0)
        return Skull(chosen, motion.in_frame(frame).shape, motion.spreads**-2)

    def _axes(self, frame: int) -> np.ndarray:
        """(3, 3) the head's axes in the capture's world, as columns."""
        turns = [
            Rotation.from_rotvec(self._part(frame, name, 3)).as_matrix()
            for name in ("global_pose", "neck_pose")
        ]
        return self._upright @ turns[0] @ turns[1]

    def _part(self, frame: int, name: str, count: int | None) -> np.ndarray:
        """The numbers of one part, flat."""
        inside = f"FLAME/{frame}/{name}"
        values = self._file.numbers(inside, None)
        if values is None:
            raise CaptureError(f"{self._file.path}: {inside} is missing.")
        if count is not None and values.size != count:
            raise CaptureError(
                f"{self._file.path}: {inside} has {values.size} values, expected {count}."
            )
        return values.ravel()
