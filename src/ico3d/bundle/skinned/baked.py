"""The file of a body on a skeleton (docs/bundle.md, body/skinned.safetensors)."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from ico3d.bundle.skinned.info import SKINNED, SKINNED_REST, SkinnedInfo
from ico3d.bundle.skinned.lamp import BakedLamp, fault_of, lamp_spec
from ico3d.bundle.tensors import (
    QUAT_UNIT,
    Axes,
    Spec,
    decode_tensors,
    encode_tensors,
    join_tensors,
    split_tensors,
)
from ico3d.errors import BundleError
from ico3d.rig.rig import Rig

WEIGHT_UNIT = 255
"""Sum of a Gaussian's four weights."""
SCALE_UNITS = (1e-3, 1.0)
"""Units of `shape_scales`: those of positions in metres (1 mm), and of colours in logits."""
_AXES: Axes = {
    "means": 0,
    "quats": 0,
    "log_scales": 0,
    "color_logits": 0,
    "opacities": 0,
    "normals": 0,
    "joints": 0,
    "weights": 0,
    "shapes": 0,
    "shape_scales": 0,
}
_UNEVEN = 1e-2
"""Largest difference of a quaternion's length from 1."""
_AT_ONCE = 1 << 16
_MAX_LENGTH = 1e4
"""Largest length in metres; longer ones are no person, and overflow when a shader squares them."""
_MAX_LOG_SCALE = 10.0
_MAX_LOGIT = 1e4
_MAX_COEFFICIENT = 1e4


@dataclass(frozen=True, eq=False)
class BakedSkinned:
    """N Gaussians at rest, bound to J joints, with the poses of the F recorded frames.

    Gaussians are sorted by importance: a device that draws n Gaussians takes the first n.

    Attributes:
        means: (N, 3) float32 positions at rest, metres.
        quats: (N, 4) int16 unit quaternions wxyz at rest, in units of 1/32767.
        log_scales: (N, 3) float16 logarithms of scales in metres.
        color_logits: (N, 3) float16 logits of r, g, b.
        opacities: (N,) uint8 in units of 1/255.
        normals: (N, 3) int8 directions in which the surface faces at rest, of any length.
        joints: (N, 4) uint8 indices of the joints that carry each Gaussian.
        weights: (N, 4) uint8 weights of these joints in units of 1/255; rows sum to 255.
        shapes: (N, K, 6) int8 residual shapes: changes of position x, y, z at rest and of the
            logits of r, g, b.
        shape_scales: (N, 2) float16 millimetres and logits per unit of the shapes.
        light: (8, 3) float32 coefficients of the spherical harmonics of degrees 1 and 2, which are
            evaluated at the posed normal and added to the logits of r, g, b.
        rig_joints: (J, 3) float32 positions of the joints at rest, metres.
        held: (J, 4) int16 local rotations wxyz of the joints that do not turn in the recording.
        moving: (M,) uint8 indices of the joints that turn, ascending.
        rotations: (F, M, 4) int16 local rotations wxyz of the joints `moving` in each frame.
        roots: (F, 3) float32 translation of the root from rest in each frame, metres.
        coefficients: (F, K) float32 coefficients of the residual shapes in each frame.
        known: (P,) int16 frames, ascending, from which coefficients of other poses are
            interpolated.
        kernel_width: (1,) float32 > 0, width of the kernel of that interpolation, in the units of
            a pose's features (`posing.any_pose`).
        info: The manifest's entry about the body.
        lamp: The lamp in whose light the body casts a shadow on itself, or None.
    """

    means: np.ndarray
    quats: np.ndarray
    log_scales: np.ndarray
    color_logits: np.ndarray
    opacities: np.ndarray
    normals: np.ndarray
    joints: np.ndarray
    weights: np.ndarray
    shapes: np.ndarray
    shape_scales: np.ndarray
    light: np.ndarray
    rig_joints: np.ndarray
    held: np.ndarray
    moving: np.ndarray
    rotations: np.ndarray
    roots: np.ndarray
    coefficients: np.ndarray
    known: np.ndarray
    kernel_width: np.ndarray
    info: SkinnedInfo
    lamp: BakedLamp | None = None

    @cached_property
    def rig(self) -> Rig:
        """The rig with its J joints at rest."""
        return self.info.rig(self.rig_joints)

    def chosen(self, indices: np.ndarray) -> "BakedSkinned":
        """The body with some of its Gaussians, by indices (M,) in the order they are to have."""
        parts = {name: self.tensors[name].take(indices, axis) for name, axis in _AXES.items()}
        info = replace(self.info, num_gaussians=len(indices), num_rest=0)
        return replace(self, **parts, info=info)

    def to_bytes(self) -> bytes:
        """Content of the file `body/skinned.safetensors`.

        Raises:
            BundleError: If shapes or dtypes disagree with the manifest's entry, or a value is out
                of range.
        """
        data = encode_tensors(self.tensors, _spec(self.info), SKINNED)
        _check_values(self)
        return data

    def split(self, first: int) -> tuple[bytes, bytes]:
        """Contents of the files with the first Gaussians, which holds all else, and of the others.

        Raises:
            BundleError: If shapes or dtypes disagree with the manifest's entry, or a value is out
                of range.
        """
        _check_values(self)
        names = SKINNED, SKINNED_REST
        return split_tensors(self.tensors, _spec(self.info), _AXES, first, names)

    @staticmethod
    def from_bytes(data: bytes, info: SkinnedInfo, rest: bytes = b"") -> "BakedSkinned":
        """Reads a body from the content of its file, or of its two files.

        Args:
            data: Content of `body/skinned.safetensors`.
            info: The manifest's entry, with whose counts the tensors must agree.
            rest: Content of `body/skinned_rest.safetensors`, where the entry has `num_rest`.

        Raises:
            BundleError: If the file is damaged, shapes or dtypes disagree with the manifest's
                entry, or a value is out of range.
        """
        if info.num_rest:
            files, names = (data, rest), (SKINNED, SKINNED_REST)
            tensors = join_tensors(files, _spec(info), _AXES, info.num_rest, names)
        else:
            tensors = decode_tensors(data, _spec(info), SKINNED)
        found = {name: tensors.pop(name) for name in lamp_spec(info)}
        baked = BakedSkinned(**tensors, info=info, lamp=BakedLamp(**found) if found else None)
        _check_values(baked)
        return baked

    @property
    def tensors(self) -> dict[str, np.ndarray]:
        """The tensors of the file by name."""
        others = ("info", "lamp")
        own = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in others}
        return own | (self.lamp.tensors if self.lamp else {})


def _spec(info: SkinnedInfo) -> Spec:
    n, k, f = info.num_gaussians, info.num_shapes, info.num_frames
    return {
        "means": ("F32", (n, 3)),
        "quats": ("I16", (n, 4)),
        "log_scales": ("F16", (n, 3)),
        "color_logits": ("F16", (n, 3)),
        "opacities": ("U8", (n,)),
        "normals": ("I8", (n, 3)),
        "joints": ("U8", (n, 4)),
        "weights": ("U8", (n, 4)),
        "shapes": ("I8", (n, k, 6)),
        "shape_scales": ("F16", (n, 2)),
        "light": ("F32", (8, 3)),
        "rig_joints": ("F32", (info.num_joints, 3)),
        "held": ("I16", (info.num_joints, 4)),
        "moving": ("U8", (info.num_moving,)),
        "rotations": ("I16", (f, info.num_moving, 4)),
        "roots": ("F32", (f, 3)),
        "coefficients": ("F32", (f, k)),
        "known": ("I16", (info.num_known,)),
        "kernel_width": ("F32", (1,)),
        **lamp_spec(info),
    }


def _blocks(rows: np.ndarray) -> Iterator[np.ndarray]:
    """Rows of stored numbers, some at a time: worked out they are four times as large."""
    for first in range(0, len(rows), _AT_ONCE):
        yield rows[first : first + _AT_ONCE]


def _reach(most: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """(N, 2) how far residual shapes (N, K, 6) move places and colours, with most (K,) of each."""
    residual = np.einsum("k,nkd->nd", most, np.abs(shapes.astype(np.float32)))  # (N, 6)
    return np.stack([residual[:, :3].max(axis=1), residual[:, 3:].max(axis=1)], 1)


def _unevenness(quats: np.ndarray) -> float:
    """By how much the length of one of the stored rotations (N, 4) differs from 1 at most."""
    lengths = np.linalg.norm(quats / np.float64(QUAT_UNIT), axis=1)
    return float(np.abs(lengths - 1).max())


def _check_values(baked: BakedSkinned) -> None:
    """Checks all values, so that Gaussians stay within bounds in any pose.

    Raises:
        BundleError: If a value is out of range.
    """
    info = baked.info
    _require(baked.joints.max() < info.num_joints, "'joints' names one that is not there")
    sums = baked.weights.sum(axis=1, dtype=np.int32)
    _require((sums == WEIGHT_UNIT).all(), f"'weights' must sum to {WEIGHT_UNIT}")
    _require(_ascends(baked.moving, info.num_joints), "'moving' must name joints in order")
    _require(_ascends(baked.known, info.num_frames), "'known' must name frames in order")
    for name in ("quats", "held", "rotations"):
        off = max(map(_unevenness, _blocks(getattr(baked, name).reshape(-1, 4))))
        _require(off <= _UNEVEN, f"'{name}' holds one that is no rotation")
    bounds = {
        "means": _MAX_LENGTH,
        "roots": _MAX_LENGTH,
        "color_logits": _MAX_LOGIT,
        "light": _MAX_LOGIT,
        "coefficients": _MAX_COEFFICIENT,
    }
    for name, most in bounds.items():
        reach = np.abs(getattr(baked, name)).max()
        _require(reach <= most, f"'{name}' is out of range, beyond {most:g}")
    _require(baked.log_scales.max() <= _MAX_LOG_SCALE, f"exceeds exp({_MAX_LOG_SCALE:g}) m")
    _require(baked.kernel_width[0] > 0, "'kernel_width' must be more than 0")
    most = np.abs(baked.coefficients.astype(np.float64)).max(axis=0)  # (K,)
    reach = np.concatenate([_reach(most, part) for part in _blocks(baked.shapes)])  # (N, 2)
    reach = reach * np.abs(baked.shape_scales.astype(np.float64)) * SCALE_UNITS
    moved = reach[:, 0].max() <= _MAX_LENGTH and reach[:, 1].max() <= _MAX_LOGIT
    _require(bool(moved), "its residual shapes are out of range")
    fault = fault_of(baked.lamp, info.num_joints) if baked.lamp else None
    _require(fault is None, str(fault))
    assert baked.rig  # making the rig checks its joints


def _ascends(numbers: np.ndarray, end: int) -> bool:
    """Whether numbers are strictly ascending, from 0 to `end` − 1."""
    values = numbers.astype(np.int64)
    return bool(values[0] >= 0 and values[-1] < end and (np.diff(values) > 0).all())


def _require(holds: bool, sentence: str) -> None:
    if not holds:
        raise BundleError(f"{SKINNED}: {sentence}.")
