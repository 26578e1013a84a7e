"""Reads a model file of SMPL-X (.npz), which users get from its makers under their licence.

Equations of the model: Pavlakos et al., "Expressive Body Capture" (CVPR 2019), and Loper et al.,
"SMPL" (2015).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.posing.smplx.joints import HANDS
from ico3d.capture.smplx import JOINTS
from ico3d.common.unpacking.npz import LackingError, TooLargeError, read_npz
from ico3d.errors import CaptureError

COEFFICIENTS = 10
"""Number of coefficients of shape, and of expression, that recordings have."""
EXPRESSIONS_FROM = {400: 300, 20: 10}
"""First expression among the directions of shape, by the least number of directions."""
LARGEST = 2**28
"""Largest size of all arrays as float64, in bytes, twice what SMPL-X has."""
ABOUT_ONE = 1e-3
"""Largest deviation of the sum of a vertex's weights from 1, and of a weight below 0."""
SHAPES = {
    "v_template": ("V", 3),
    "shapedirs": ("V", 3, "K"),
    "J_regressor": (JOINTS, "V"),
    "weights": ("V", JOINTS),
    "kintree_table": (2, JOINTS),
    "f": ("T", 3),
    "hands_meanl": (45,),
    "hands_meanr": (45,),
}
"""Shapes of the arrays that are read; a letter stands for a number that is the same everywhere."""


@dataclass(frozen=True, eq=False)
class BodyModel:
    """SMPL-X without its pose-dependent corrections.

    Attributes:
        vertices: (V, 3) mean surface, metres; +y up, facing +z.
        shapes: (V, 3, 10) change of the surface with each coefficient of shape, metres.
        expressions: (V, 3, 10) change of the surface with each coefficient of expression, metres.
        regressor: (55, V) weights of the vertices whose sum is a joint's position.
        weights: (V, 55) share of each joint in the motion of a vertex; rows sum to 1.
        parents: Index of each joint's parent; −1 for joint 0.
        faces: (T, 3) int32 corners of the surface's triangles.
        hands: (55, 3) mean axis-angle rotations of the hands' joints, radians; 0 for other joints.
    """

    vertices: np.ndarray
    shapes: np.ndarray
    expressions: np.ndarray
    regressor: np.ndarray
    weights: np.ndarray
    parents: tuple[int, ...]
    faces: np.ndarray
    hands: np.ndarray

    def shaped(self, betas: np.ndarray, expression: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A person's surface at rest, and the joints in it.

        Args:
            betas: (10,) coefficients of shape.
            expression: (10,) coefficients of expression.

        Returns:
            (V, 3) vertices and (55, 3) joints, metres.
        """
        vertices = self.vertices + self.shapes @ betas + self.expressions @ expression  # (V, 3)
        return vertices, self.regressor @ vertices


def read_model(file: Path) -> BodyModel:
    """Reads a model file; its pickled parts are never opened.

    Args:
        file: An .npz file of SMPL-X 1.1 (or 1.0, with 20 directions of shape).

    Raises:
        CaptureError: If the file is missing, damaged or no SMPL-X model in this format.
    """
    arrays = _arrays(file)
    count = arrays["shapedirs"].shape[2]
    first = next((start for least, start in EXPRESSIONS_FROM.items() if count >= least), None)
    faces, table = arrays["f"].astype(np.int64), arrays["kintree_table"].astype(np.int64)
    weights = arrays["weights"].astype(np.float64)
    if first is None:
        raise _wrong(file, f"'shapedirs' has {count} directions, at least 20 are needed")
    if not faces.size:
        raise _wrong(file, "'f' is empty")
    if not (faces.min() >= 0 and faces.max() < len(weights)):
        raise _wrong(file, "'f' names a vertex that is not there")
    if weights.min(initial=0) < -ABOUT_ONE or np.abs(weights.sum(1) - 1).max(initial=0) > ABOUT_ONE:
        raise _wrong(file, "'weights' has a row that is negative or does not sum to 1")
    joints = np.arange(1, JOINTS)
    if not ((table[1, 1:] == joints) & (table[0, 1:] >= 0) & (table[0, 1:] < joints)).all():
        raise _wrong(file, "'kintree_table' is no tree with parents before children")
    hands = np.zeros((JOINTS, 3))
    for name, fingers in HANDS.items():
        hands[fingers] = arrays[name].reshape(-1, 3)
    directions = arrays["shapedirs"]  # (V, 3, K)
    return BodyModel(
        arrays["v_template"].astype(np.float64),
        directions[..., :COEFFICIENTS].astype(np.float64),
        directions[..., first : first + COEFFICIENTS].astype(np.float64),
        arrays["J_regressor"].astype(np.float64),
        np.maximum(weights, 0),
        (-1, *table[0, 1:].tolist()),
        faces.astype(np.int32),
        hands,
    )


def _arrays(file: Path) -> dict[str, np.ndarray]:
    """The arrays of `SHAPES`: real, finite numbers of the right shapes."""
    try:
        arrays = read_npz(file, LARGEST, SHAPES)
    except FileNotFoundError as error:
        raise CaptureError(f"there is no SMPL-X model {file}.") from error
    except LackingError as error:
        raise _wrong(file, f"it lacks {error}") from error
    except TooLargeError as error:
        raise _wrong(file, "its arrays are larger than those of SMPL-X") from error
    except (OSError, ValueError) as error:
        raise _wrong(file, "it is damaged, or pickled (.pkl)") from error
    lengths: dict[str | int, int] = {}
    for name, shape in SHAPES.items():
        found = arrays[name]
        wanted = [lengths.get(n, n) for n in shape]
        fits = len(wanted) == found.ndim and all(
            n == m or isinstance(n, str) for n, m in zip(wanted, found.shape, strict=True)
        )
        if not fits:
            text = " x ".join("any" if isinstance(n, str) else str(n) for n in wanted)
            raise _wrong(file, f"'{name}' has shape {found.shape}, expected {text}")
        lengths |= {n: m for n, m in zip(shape, found.shape, strict=True) if isinstance(n, str)}
        if found.dtype.kind not in "fiu" or not np.isfinite(found).all():
            raise _wrong(file, f"'{name}' holds values that are no finite numbers")
    return arrays


def _wrong(file: Path, why: str) -> CaptureError:
    return CaptureError(
        f"{file} is no SMPL-X model that can be read: {why}; the .npz files of "
        "smpl-x.is.tue.mpg.de (version 1.1) can."
    )
