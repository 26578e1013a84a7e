"""The baked head: tensors that a shader blends (docs/bundle.md, head.safetensors)."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from ico3d.bundle.manifest import HeadInfo
from ico3d.bundle.tensors import (
    Axes,
    Spec,
    decode_tensors,
    encode_tensors,
    join_tensors,
    split_tensors,
)
from ico3d.common.expression import MOVE_HIDDEN
from ico3d.errors import BundleError

HEAD = "head.safetensors"
HEAD_REST = "head_rest.safetensors"
POSES = "head_poses.safetensors"
SHOULDERS = "head_shoulders.safetensors"
_AXES: Axes = {
    "means": 0,
    "quats": 0,
    "scales": 0,
    "mean_logits": 0,
    "basis": 1,
    "basis_scale": 0,
    "displacement_basis": 1,
}
_MAX_LOG_SCALE = 10.0
_MAX_STEP = 1.0
_MAX_LENGTH = 1e4
"""Metres; anything farther is no person, and overflows when it is squared in a shader."""


@dataclass(frozen=True)
class BakedHead:
    """N Gaussians in canonical head space; colour and opacity are low-rank in the expression.

    Where there are M > 0 displacements, Gaussians also move with the expression. Baked
    heads have their Gaussians sorted by importance.

    Attributes:
        means: (N, 3) float32 metres.
        quats: (N, 4) float16 wxyz, normalised.
        scales: (N, 3) float16, natural logarithms of standard deviations in metres.
        mean_logits: (N, 4) float16 mean logits Ȳ of r, g, b and opacity.
        basis: (K, N, 4) int8 basis vectors of the logits.
        basis_scale: (N,) float32 logits per unit of `basis`.
        displacement_basis: (M, N, 3) int8 displacements of the centres.
        displacement_w1: (B, G) float32, first layer of the network from an expression to metres per
            unit of `displacement_basis`; G is `MOVE_HIDDEN`.
        displacement_b1: (G,) float32, first layer's bias.
        displacement_w2: (G, M) float32, second layer.
        displacement_b2: (M,) float32, second layer's bias.
        w1: (B, H) float32, first layer of the coefficient network.
        b1: (H,) float32, first layer's bias.
        w2: (H, K) float32, second layer.
        b2: (K,) float32, second layer's bias.
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    mean_logits: np.ndarray
    basis: np.ndarray
    basis_scale: np.ndarray
    displacement_basis: np.ndarray
    displacement_w1: np.ndarray
    displacement_b1: np.ndarray
    displacement_w2: np.ndarray
    displacement_b2: np.ndarray
    w1: np.ndarray
    b1: np.ndarray
    w2: np.ndarray
    b2: np.ndarray

    @property
    def num_gaussians(self) -> int:
        """N, the number of Gaussians."""
        return self.means.shape[0]

    @property
    def rank(self) -> int:
        """K, the number of basis vectors."""
        return self.basis.shape[0]

    @property
    def num_displacements(self) -> int:
        """M, the number of displacements of each Gaussian."""
        return self.displacement_basis.shape[0]

    @property
    def hidden(self) -> int:
        """H, the width of the coefficient network."""
        return self.b1.shape[0]

    @property
    def expression_size(self) -> int:
        """B, the number of values of an expression."""
        return self.w1.shape[0]

    def chosen(self, indices: np.ndarray) -> "BakedHead":
        """The head with some of its Gaussians, by indices (M,) in the order they are to have."""
        parts = {name: self._tensors[name].take(indices, axis) for name, axis in _AXES.items()}
        return replace(self, **parts)

    def preceded(self, more: Mapping[str, np.ndarray]) -> "BakedHead":
        """The head after further Gaussians, whose tensors are given by name in any type."""
        own = self._tensors
        parts = {
            name: np.concatenate([more[name].astype(own[name].dtype), own[name]], axis)
            for name, axis in _AXES.items()
        }
        return replace(self, **parts)

    def to_bytes(self) -> bytes:
        """The content of `head.safetensors`.

        Raises:
            BundleError: If shapes or dtypes do not fit one another, or a value is out of range.
        """
        data = encode_tensors(self._tensors, self._spec, HEAD)
        _check_values(self)
        return data

    def split(self, first: int) -> tuple[bytes, bytes]:
        """Contents of `head.safetensors` with the first Gaussians, and `head_rest.safetensors`.

        Raises:
            BundleError: If shapes or dtypes do not fit one another, or a value is out of range.
        """
        _check_values(self)
        spec = self._spec
        return split_tensors(self._tensors, spec, _axes_of(spec), first, (HEAD, HEAD_REST))

    @property
    def _tensors(self) -> dict[str, np.ndarray]:
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def _spec(self) -> Spec:
        return _head_spec(
            self.num_gaussians,
            self.rank,
            self.hidden,
            self.expression_size,
            self.num_displacements,
        )

    @staticmethod
    def from_bytes(data: bytes, info: HeadInfo, rest: bytes = b"") -> "BakedHead":
        """Reads a head and checks it against the manifest's counts.

        Args:
            data: Content of `head.safetensors`.
            info: The manifest's entry.
            rest: Content of `head_rest.safetensors`, where the entry has `num_rest`.

        Raises:
            BundleError: If a file is malformed or does not fit the manifest.
        """
        size, moved = info.expression_size, info.num_displacements
        spec = _head_spec(info.num_gaussians, info.rank, info.hidden, size, moved)
        if info.num_rest:
            names = (HEAD, HEAD_REST)
            tensors = join_tensors((data, rest), spec, _axes_of(spec), info.num_rest, names)
        else:
            tensors = decode_tensors(data, spec, HEAD)
        if not moved:
            tensors |= no_displacements(info.num_gaussians, size)
        head = BakedHead(**tensors)
        _check_values(head)
        return head


@dataclass(frozen=True)
class BakedShoulders:
    """Where the shoulders are, and which Gaussians are theirs.

    Attributes:
        share: (N,) uint8 how much of the shoulders' movement each Gaussian of the head makes, 255
            for all of it.
        world_from_shoulders: (F, 4, 4) float32 rigid: where canonical head space is in each head
            pose for whatever moves with the shoulders.
    """

    share: np.ndarray
    world_from_shoulders: np.ndarray

    def to_bytes(self) -> bytes:
        """The content of `head_shoulders.safetensors`.

        Raises:
            BundleError: If shapes or dtypes do not fit, or a transform is not rigid.
        """
        _check_rigid(self.world_from_shoulders, SHOULDERS)
        return encode_tensors(
            vars(self), _shoulders_spec(len(self.share), len(self.world_from_shoulders)), SHOULDERS
        )

    @staticmethod
    def from_bytes(data: bytes, info: HeadInfo) -> "BakedShoulders":
        """Reads the file, and checks it against the manifest's counts.

        Raises:
            BundleError: If the file is malformed, or a transform is not rigid.
        """
        tensors = decode_tensors(
            data, _shoulders_spec(info.num_gaussians, info.num_poses), SHOULDERS
        )
        _check_rigid(tensors["world_from_shoulders"], SHOULDERS)
        return BakedShoulders(**tensors)


def no_displacements(num_gaussians: int, expression_size: int) -> dict[str, np.ndarray]:
    """The displacements of a head whose N Gaussians stand still, for B values of an expression."""
    return {
        "displacement_basis": np.zeros((0, num_gaussians, 3), np.int8),
        "displacement_w1": np.zeros((expression_size, MOVE_HIDDEN), np.float32),
        "displacement_b1": np.zeros(MOVE_HIDDEN, np.float32),
        "displacement_w2": np.zeros((MOVE_HIDDEN, 0), np.float32),
        "displacement_b2": np.zeros(0, np.float32),
    }


def poses_to_bytes(world_from_head: np.ndarray) -> bytes:
    """The content of `head_poses.safetensors` from (F, 4, 4) rigid transforms.

    Raises:
        BundleError: If a transform is not rigid.
    """
    spec = _poses_spec(len(world_from_head))
    poses = np.asarray(world_from_head, np.float32)
    _check_rigid(poses, POSES)
    return encode_tensors({"world_from_head": poses}, spec, POSES)


def poses_from_bytes(data: bytes, num_poses: int) -> np.ndarray:
    """Reads `head_poses.safetensors` as (F, 4, 4) float32.

    Raises:
        BundleError: If the file is malformed or a pose is not rigid.
    """
    poses = decode_tensors(data, _poses_spec(num_poses), POSES)["world_from_head"]
    _check_rigid(poses, POSES)
    return poses


def _head_spec(n: int, k: int, h: int, b: int, m: int) -> Spec:
    moving: Spec = {
        "displacement_basis": ("I8", (m, n, 3)),
        "displacement_w1": ("F32", (b, MOVE_HIDDEN)),
        "displacement_b1": ("F32", (MOVE_HIDDEN,)),
        "displacement_w2": ("F32", (MOVE_HIDDEN, m)),
        "displacement_b2": ("F32", (m,)),
    }
    return (dict(moving) if m else {}) | {
        "means": ("F32", (n, 3)),
        "quats": ("F16", (n, 4)),
        "scales": ("F16", (n, 3)),
        "mean_logits": ("F16", (n, 4)),
        "basis": ("I8", (k, n, 4)),
        "basis_scale": ("F32", (n,)),
        "w1": ("F32", (b, h)),
        "b1": ("F32", (h,)),
        "w2": ("F32", (h, k)),
        "b2": ("F32", (k,)),
    }


def _axes_of(spec: Spec) -> Axes:
    """The axes of the tensors that a head has."""
    return {name: axis for name, axis in _AXES.items() if name in spec}


def _poses_spec(f: int) -> Spec:
    return {"world_from_head": ("F32", (f, 4, 4))}


def _shoulders_spec(n: int, f: int) -> Spec:
    return {"share": ("U8", (n,)), "world_from_shoulders": ("F32", (f, 4, 4))}


def _check_values(head: BakedHead) -> None:
    if np.abs(head.means).max() > _MAX_LENGTH:
        raise BundleError(f"{HEAD}: 'means' reaches farther than {_MAX_LENGTH:g} m.")
    if head.scales.max() > _MAX_LOG_SCALE:
        raise BundleError(f"{HEAD}: 'scales' exceeds exp({_MAX_LOG_SCALE:g}) m.")
    for name in ("displacement_w2", "displacement_b2"):
        if (np.abs(getattr(head, name)) > _MAX_STEP).any():
            raise BundleError(f"{HEAD}: '{name}' has steps of more than {_MAX_STEP:g} m.")
    norms = np.linalg.norm(head.quats.astype(np.float32), axis=1)
    if np.abs(norms - 1).max() > 1e-2:
        raise BundleError(f"{HEAD}: 'quats' are not normalised.")


def _check_rigid(poses: np.ndarray, file: str) -> None:
    """Checks transforms (F, 4, 4) of a file.

    Raises:
        BundleError: If one of them is not rigid.
    """
    rotations = poses[:, :3, :3].astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        gram = rotations @ rotations.transpose(0, 2, 1)  # (F, 3, 3)
        off = np.abs(gram - np.eye(3)).max(axis=(1, 2))
        last = np.abs(poses[:, 3] - (0, 0, 0, 1)).max(axis=1)
        rigid = (off < 1e-3) & (last < 1e-6) & (np.linalg.det(rotations) > 0)
    rigid &= np.abs(poses[:, :3, 3]).max(axis=1) < _MAX_LENGTH
    if not rigid.all():
        raise BundleError(f"{file}: pose {int(np.argmin(rigid))} is not a rigid transform.")
