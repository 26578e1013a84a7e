"""MediaPipe's face model: landmarks and blendshapes of a picture, and the canonical face."""

import struct
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.capture.decoding import check_size
from ico3d.common.native.hidden import hidden
from ico3d.common.native.messages import held_back
from ico3d.errors import CaptureError, MissingExtraError

LANDMARKS = 478
MESH_LANDMARKS = 468
"""Number of landmarks on the face's surface; the ten that follow are on the irises."""


@dataclass(frozen=True)
class Face:
    """A face found in a picture.

    Attributes:
        landmarks: (478, 2) pixels, pixel centres at +0.5.
        blendshapes: (52,) weights.
        pose: (4, 4) from MediaPipe's canonical face (cm) to a camera of 63 degrees vertical field
            of view in OpenGL axes; only accurate enough as a starting point.
        depths: (478,) pixels, how far behind the head's middle each landmark lies, to the scale of
            `landmarks`; None where they were not kept.
    """

    landmarks: np.ndarray
    blendshapes: np.ndarray
    pose: np.ndarray
    depths: np.ndarray | None = None


class FaceReader:
    """Finds the face in single pictures.

    MediaPipe's video mode filters landmarks over time, which delays them by about half a frame
    (measured on a clip of 25 frames per second). Single pictures have no delay, and ico3d smooths
    without one.
    """

    def __init__(self, model: Path, most: int = 1):
        """Loads the model.

        Args:
            model: Path of `face_landmarker.task`.
            most: Number of faces that are looked for in a picture.

        Raises:
            MissingExtraError: If MediaPipe is not installed.
            CaptureError: If the model file cannot be used.
        """
        try:
            with hidden("sounddevice"):  # which looks for a library in the current folder
                import mediapipe
                from mediapipe.tasks.python import BaseOptions, vision
        except ImportError as error:
            raise MissingExtraError("mediapipe", "face", "tracking a portrait") from error
        self._mediapipe = mediapipe
        options = vision.FaceLandmarkerOptions(
            base_options=BaseOptions(model_asset_path=str(model)),
            running_mode=vision.RunningMode.IMAGE,
            num_faces=most,
            output_face_blendshapes=True,
            output_facial_transformation_matrixes=True,
        )
        try:
            with held_back():
                self._landmarker = vision.FaceLandmarker.create_from_options(options)
        except (RuntimeError, ValueError, OSError) as error:
            raise CaptureError(f"{model} is no usable face landmarker model: {error}.") from error
        self.names: tuple[str, ...] = ()

    def __enter__(self) -> "FaceReader":
        return self

    def __exit__(self, *_) -> None:
        self._landmarker.close()

    def read(self, image: np.ndarray) -> Face | None:
        """The face in a picture, or one of several; None if there is none.

        Args:
            image: uint8 RGB (H, W, 3), contiguous.

        Returns:
            The face, or None.
        """
        found = self.faces(image)
        return found[0] if found else None

    def faces(self, image: np.ndarray) -> list[Face]:
        """As many faces of a picture, uint8 RGB (H, W, 3), as are looked for.

        Raises:
            CaptureError: If the picture is larger than is taken.
        """
        found = self._landmarker.detect(packed(self._mediapipe, image))
        if found.face_blendshapes:
            self.names = tuple(shape.category_name for shape in found.face_blendshapes[0])
        parts = (found.face_landmarks, found.face_blendshapes, found.facial_transformation_matrixes)
        return [_face(image, *one) for one in zip(*parts, strict=True)]


def packed(mediapipe: Any, picture: np.ndarray) -> Any:
    """A picture, uint8 RGB (H, W, 3), as MediaPipe takes it.

    Raises:
        CaptureError: If it is larger than is taken: MediaPipe would end the process.
    """
    height, width = picture.shape[:2]
    check_size("what is looked at", width, height)
    form = mediapipe.ImageFormat.SRGB
    return mediapipe.Image(image_format=form, data=np.ascontiguousarray(picture))


def _face(image: np.ndarray, points: Any, shapes: Any, pose: Any) -> Face:
    """A face as MediaPipe tells it."""
    height, width = image.shape[:2]
    return Face(
        np.array([(p.x * width, p.y * height) for p in points]),
        np.array([shape.score for shape in shapes], np.float32),
        np.asarray(pose, np.float64),
        np.array([p.z * width for p in points]),
    )


@dataclass(frozen=True)
class CanonicalFace:
    """MediaPipe's canonical face, the mean shape of its landmarks.

    Attributes:
        vertices: (468, 3) metres; +x to the person's left, +y up, +z forward, origin in the middle
            of the head.
        triangles: (T, 3) indices of vertices.
        rigidity: (468,) weights in [0, 1] by which MediaPipe aligns heads.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    rigidity: np.ndarray


def canonical_face(model: Path) -> CanonicalFace:
    """Reads the canonical face from the model file.

    Args:
        model: `face_landmarker.task`, a zip that holds the mesh as a protocol buffer.

    Raises:
        CaptureError: If the file does not hold the mesh where expected.
    """
    try:
        with zipfile.ZipFile(model) as archive:
            data = archive.read("geometry_pipeline_metadata_landmarks.binarypb")
        top = list(_fields(data))
        mesh = list(_fields(next(value for key, value in top if key == 1)))
        floats = [struct.unpack("<f", value)[0] for key, value in mesh if key == 3]
        indices = [value for key, value in mesh if key == 4]
        vertices = np.asarray(floats, np.float64).reshape(MESH_LANDMARKS, 5)  # x y z u v, cm
        rigidity = np.zeros(MESH_LANDMARKS)
        for key, value in top:
            if key == 2:
                basis = dict(_fields(value))
                rigidity[basis[1]] = struct.unpack("<f", basis[2])[0]
    except (zipfile.BadZipFile, KeyError, OSError, IndexError, struct.error, ValueError) as error:
        raise CaptureError(f"{model} holds no canonical face mesh; is it damaged?") from error
    triangles = np.asarray(indices, np.int64).reshape(-1, 3)
    return CanonicalFace(vertices[:, :3] * 0.01, triangles, rigidity / rigidity.max())


def _fields(data: bytes) -> Iterator[tuple[int, Any]]:
    """The fields of one protocol-buffer message: (number, integer or bytes)."""
    position = 0
    while position < len(data):
        key, position = _varint(data, position)
        number, wire = key >> 3, key & 7
        if wire == 0:
            value, position = _varint(data, position)
        else:
            length = 4 if wire == 5 else 8
            if wire == 2:
                length, position = _varint(data, position)
            value = data[position : position + length]
            position += length
        yield number, value


def _varint(data: bytes, position: int) -> tuple[int, int]:
    """One variable-length integer and the position after it."""
    value = shift = 0
    while True:
        byte = data[position]
        position += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return value, position
