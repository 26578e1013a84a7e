"""Finds roughly where the face of a head model is, whichever way the head is turned."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.avatar.joining.finding.drawn_head import DrawnHead
from ico3d.avatar.joining.similarity import moved, scale_of
from ico3d.capture.face.mediapipe_face import MESH_LANDMARKS, CanonicalFace, FaceReader
from ico3d.capture.headpose.shape import similarity_fit
from ico3d.capture.headtrack.crops import Part, search
from ico3d.common.camera import Camera, look_at
from ico3d.common.spread import directions
from ico3d.splat.gaussians import Gaussians

DIRECTIONS, ROLLS = 40, (0, 90, -90, 180)
"""Cameras around the head: number of directions, and rotations in degrees about each of them.

MediaPipe finds faces that are rotated by up to 45° from these.
"""
PIXELS, AWAY, WIDE = 512, 5.0, 2.4
"""Side of a picture in pixels; distance of its camera and width shown, in radii of the head."""
OPAQUE, MOST = 0.3, 0.9
"""Opacity above which a Gaussian counts, and the share of such Gaussians within the head's radius.
"""
CERTAIN = 0.5
"""Alpha above which a pixel shows something opaque."""
SHAPED = 0.008
"""Mean distance in metres, on a face of usual size, up to which a found shape is surely a face.

Wrong faces, such as one upside down, deviate by 12 mm and more.
"""
LEAST_HELD = 1e-3
"""Least weight in fits, given to landmarks by which MediaPipe does not align heads."""
LEAST_SEEN = 0.8
"""Share of the landmarks that must lie on something opaque."""


def first_looks(
    gaussians: Gaussians, canonical: CanonicalFace, reader: FaceReader
) -> Iterator[np.ndarray]:
    """Places where something looks like a face, likely ones first.

    Args:
        gaussians: The head, in any orientation and unit.
        canonical: MediaPipe's canonical face model.
        reader: Finds faces in pictures.

    Yields:
        (4, 4) similarities from the space of the canonical face to that of the head.
    """
    solid = gaussians.means[gaussians.opacities > OPAQUE].detach().double().cpu().numpy()  # (S, 3)
    if not len(solid):
        return
    middle = np.median(solid, axis=0)
    radius = float(np.quantile(np.linalg.norm(solid - middle, axis=1), MOST))
    studio = DrawnHead(gaussians, _cameras(middle, radius))
    doubtful = []
    for look in range(len(studio.cameras)):
        found = _look(studio, look, canonical, reader)
        if found is None:
            continue
        away, place = found
        if away < SHAPED:
            yield place
        else:
            doubtful.append((away, look, place))
    yield from (place for *_, place in sorted(doubtful, key=lambda found: found[:2]))


def _look(
    studio: DrawnHead, number: int, canonical: CanonicalFace, reader: FaceReader
) -> tuple[float, np.ndarray] | None:
    """The face in the picture of camera `number`; None where none is found.

    Returns:
        Mean distance in metres from a face's shape, at the usual size of a face, and the (4, 4)
        similarity from the canonical face to the head.
    """
    drawn = studio.drawn(number)
    image, alpha = drawn.rgb[0].clamp(0, 1).cpu().numpy(), drawn.alpha[0].cpu().numpy()
    for part in _large(search(PIXELS, PIXELS, alpha)):
        face = reader.read(part.cut(image))
        if face is not None:
            pixels = part.whole(face.landmarks[:MESH_LANDMARKS])  # (468, 2)
            depth = drawn.depth[0].cpu().numpy()
            return _placed(studio.cameras[number], pixels, depth, alpha, canonical)
    return None


def _cameras(middle: np.ndarray, radius: float) -> list[Camera]:
    """Cameras all around a head; the first see a face that looks along +z with +y up."""
    focal = PIXELS * AWAY / WIDE
    intrinsics = np.array([[focal, 0, PIXELS / 2], [0, focal, PIXELS / 2], [0, 0, 1]])
    cameras = []
    for roll in ROLLS:
        for way in directions(DIRECTIONS):
            turn = Rotation.from_rotvec(np.radians(roll) * way)
            pose = look_at(middle + AWAY * radius * way, middle, turn.apply([0.0, 1.0, 0.0]))
            cameras.append(Camera(PIXELS, PIXELS, intrinsics, pose))
    return cameras


def _large(parts: list[Part]) -> list[Part]:
    """The parts at least half as wide as the widest: the face is a large part of a head."""
    largest = max((part.side for part in parts), default=0)
    return [part for part in parts if part.side >= largest // 2]


def _placed(
    camera: Camera,
    pixels: np.ndarray,
    depth: np.ndarray,
    alpha: np.ndarray,
    canonical: CanonicalFace,
) -> tuple[float, np.ndarray] | None:
    """Fits the canonical face to what is drawn at pixels of landmarks.

    Args:
        camera: The camera of the picture.
        pixels: (468, 2) landmarks in the picture.
        depth: (H, W) depth along the camera's z axis.
        alpha: (H, W) how opaque the picture is.
        canonical: MediaPipe's canonical face model.

    Returns:
        As from `_look`; None where less than `LEAST_SEEN` of the landmarks lie on the head.
    """
    columns, rows = np.floor(pixels).astype(int).clip(0, PIXELS - 1).T
    seen = alpha[rows, columns] > CERTAIN  # (468,)
    if seen.mean() < LEAST_SEEN:
        return None
    ends = np.append(pixels, np.ones((len(pixels), 1)), 1)  # (468, 3)
    local = ends @ np.linalg.inv(camera.intrinsics).T * depth[rows, columns, None]  # (468, 3)
    points = moved(camera.camera_to_world, local)
    weights = np.maximum(canonical.rigidity, LEAST_HELD) * seen
    place = similarity_fit(canonical.vertices, points[None], weights)[0]
    away = np.linalg.norm(moved(place, canonical.vertices) - points, axis=1)
    return float(np.average(away, weights=weights) / scale_of(place)), place
