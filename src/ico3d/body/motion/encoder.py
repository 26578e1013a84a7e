"""The space-time encoder: features of a position and a time (paper, equation of φ(f_v)).

As in the paper it is a HexPlane: for each pair of axes of space and time there is a plane of
features. The six planes are sampled bilinearly and their samples multiplied, at one or more
resolutions of space.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import grid_sample, pad

from ico3d.body.motion import encoder_kernels as kernels
from ico3d.common.native.jit import numba
from ico3d.errors import SettingsError

SPACE_PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
"""The planes of space, each with the axes of its columns and its rows."""
TIME_PLANES = ("xt", "yt", "zt")
"""The planes of time: columns are positions along x, y or z, rows are times."""
SPACE_RANGE = (0.1, 0.5)
"""Range of the initial random values of space planes; time planes begin at 1: nothing moves."""
MOST_SCALES = 16
"""Largest number of scales."""
SUMS = 4
"""Number of parts of the points; gradients are summed within each part, by one thread."""


@dataclass(frozen=True)
class EncoderShape:
    """Sizes of the encoder's planes.

    Attributes:
        space: Number of nodes along each of x, y and z, for each scale.
        time: Number of nodes along time, at every scale; one for each frame is usual.
        channels: Features per scale.
    """

    space: tuple[int, ...] = (32,)
    time: int = 16
    channels: int = 16

    def __post_init__(self):
        """Checks the sizes.

        Raises:
            SettingsError: If a plane would be empty, or there are more than `MOST_SCALES`.
        """
        if len(self.space) > MOST_SCALES:
            raise SettingsError(f"An encoder has at most {MOST_SCALES} scales.")
        if not self.space or min(self.space) < 2 or self.time < 1 or self.channels < 1:
            raise SettingsError(
                f"An encoder of {self.space} places, {self.time} times and {self.channels} "
                "channels does not exist: give at least 2 places per scale, 1 time and 1 channel."
            )

    @property
    def outputs(self) -> int:
        """Number of features of a position, over all scales."""
        return len(self.space) * self.channels

    def planes(self, scale: int) -> dict[str, tuple[int, int, int]]:
        """Names and sizes (rows, columns, channels) of the planes of one scale."""
        places = self.space[scale]
        space = {f"{name}{scale}": (places, places, self.channels) for name in SPACE_PLANES}
        times = {f"{name}{scale}": (self.time, places, self.channels) for name in TIME_PLANES}
        return space | times


def initial_planes(shape: EncoderShape, generator: torch.Generator) -> dict[str, Tensor]:
    """Initial planes by name: the axes of columns and rows, then the scale, such as "xt0".

    Args:
        shape: Sizes of the planes.
        generator: Draws the values of space planes.

    Returns:
        For each scale of S nodes: xy, xz, yz (S, S, channels) and xt, yt, zt (time, S, channels).
    """
    planes = {}
    for scale in range(len(shape.space)):
        for name, size in shape.planes(scale).items():
            planes[name] = torch.ones(size)
            if name[:2] in SPACE_PLANES:
                planes[name].uniform_(*SPACE_RANGE, generator=generator)
    return planes


def encode(
    planes: dict[str, Tensor], shape: EncoderShape, positions: Tensor, time: float
) -> Tensor:
    """Features of positions at one time.

    Planes are interpolated bilinearly between their nodes, the first and last of which are at −1
    and 1 in space and at 0 and 1 in time. Positions outside have the features of the border.

    Args:
        planes: The encoder's planes, in the layout of `initial_planes`.
        shape: Sizes of the planes.
        positions: (N, 3), from −1 to 1 inside the box that the planes cover.
        time: Time in the window, 0 to 1.

    Returns:
        (N, outputs), differentiable in planes and positions.

    Raises:
        ValueError: If planes or positions do not have these sizes.
    """
    if positions.shape[1:] != (3,):
        raise ValueError(f"positions must be (N, 3), not {tuple(positions.shape)}")
    scales = []
    for scale in range(len(shape.space)):
        chosen = [planes[name] for name in shape.planes(scale)]
        if [plane.shape for plane in chosen] != list(shape.planes(scale).values()):
            raise ValueError(f"the planes of scale {scale} must be {shape.planes(scale)}")
        if all(_has_kernel(tensor) for tensor in (positions, *chosen)):
            scales.append(_Product.apply(time, positions, *chosen))
        else:
            lines = [_line(plane, *_row(shape.time, time)) for plane in chosen[3:]]
            scales.append(_product(positions, chosen[:3], lines))
    return torch.cat(scales, 1)


def _has_kernel(tensor: Tensor) -> bool:
    return tensor.device.type == "cpu" and tensor.dtype == torch.float32


def _product(positions: Tensor, planes: list[Tensor], lines: list[Tensor]) -> Tensor:
    """(N, C) products of samples of three planes (S, S, C) and three lines (S, C)."""
    product = torch.ones_like(positions[:, :1])
    for plane, axes in zip(planes, SPACE_PLANES.values(), strict=True):
        product = product * _sample(plane, positions[:, axes])
    for axis, line in enumerate(lines):
        place = positions[:, axis]
        product = product * _sample(line[None], torch.stack([place, torch.zeros_like(place)], 1))
    return product


def _sample(plane: Tensor, places: Tensor) -> Tensor:
    """(N, C) samples of a plane (H, W, C) at columns and rows (N, 2) within −1 … 1."""
    sampled = grid_sample(
        plane.permute(2, 0, 1)[None],  # (1, C, H, W)
        places[None, None],  # (1, 1, N, 2)
        padding_mode="border",
        align_corners=True,
    )  # (1, C, 1, N)
    return sampled[0, :, 0].T


def _line(plane: Tensor, row: int, part: float) -> Tensor:
    """(S, C): a time plane (T, S, C) interpolated between a row (part 0) and the next (part 1)."""
    return plane[row] if part == 0 else torch.lerp(plane[row], plane[row + 1], part)


def _row(times: int, time: float) -> tuple[int, float]:
    """The row at or before a time of 0 to 1, and the share of the way to the next row."""
    place = min(max(time, 0.0), 1.0) * (times - 1)
    return int(place), place - int(place)


class _Product(torch.autograd.Function):
    """`_product` for the lines of one time, computed by numba kernels.

    Gradients are summed over a fixed number of parts of the points, so that they do not depend on
    the number of threads.
    """

    @staticmethod
    def forward(ctx, time: float, positions: Tensor, *planes: Tensor) -> Tensor:
        row, part = _row(len(planes[-1]), time)
        lines = [_line(plane, row, part) for plane in planes[3:]]
        sampled = [_grouped(tensor) for tensor in (*planes[:3], *lines)]
        positions = positions.contiguous()
        features = positions.new_empty(len(positions), *sampled[0].shape[2:])
        kernels.forward(numba.get_num_threads(), *_arrays(*sampled, positions, features))
        ctx.save_for_backward(positions, *sampled)
        ctx.row, ctx.part, ctx.sizes = row, part, [plane.shape for plane in planes]
        return _channels(features, planes[0].shape[-1])

    @staticmethod
    def backward(ctx, *gradients: Tensor):
        positions, *sampled = ctx.saved_tensors
        g_positions = torch.zeros_like(positions)
        g_planes = positions.new_zeros(SUMS, 3, *sampled[0].shape)
        g_lines = positions.new_zeros(SUMS, 3, *sampled[-1].shape)
        taken = (*sampled, positions, _grouped(gradients[0]))
        kernels.backward(*_arrays(*taken, g_planes, g_lines, g_positions))
        channels = gradients[0].shape[1]
        by_planes = _channels(g_planes.sum(0), channels)  # (3, S, S, C)
        by_lines = _channels(g_lines.sum(0), channels)  # (3, S, C)
        by_times = [
            _on_rows(line, size, ctx.row, ctx.part)
            for line, size in zip(by_lines, ctx.sizes[3:], strict=True)
        ]
        return None, g_positions, *by_planes, *by_times


def _on_rows(line: Tensor, size: torch.Size, row: int, part: float) -> Tensor:
    """Gradient (T, S, C) of a time plane from the gradient (S, C) of its `_line`."""
    gradient = line.new_zeros(size)
    gradient[row] = line * (1 - part)
    if part > 0:
        gradient[row + 1] = line * part
    return gradient


def _grouped(tensor: Tensor) -> Tensor:
    """Channels (…, C) as groups (…, groups, LANES) for the kernels, the last filled with zeros."""
    missing = -tensor.shape[-1] % kernels.LANES
    padded = pad(tensor, (0, missing)) if missing else tensor
    return padded.unflatten(-1, (-1, kernels.LANES)).contiguous()


def _channels(grouped: Tensor, channels: int) -> Tensor:
    """Channels (…, C) from groups (…, groups, LANES); inverse of `_grouped`."""
    return grouped.flatten(-2)[..., :channels]


def _arrays(*tensors: Tensor) -> list[np.ndarray]:
    return [tensor.detach().numpy() for tensor in tensors]


def space_smoothness(planes: dict[str, Tensor]) -> Tensor:
    """Mean squared second difference along both axes of the space planes."""
    chosen = [plane for name, plane in planes.items() if name[:2] in SPACE_PLANES]
    return _mean_square([plane.diff(2, axis) for plane in chosen for axis in (0, 1)])


def time_smoothness(planes: dict[str, Tensor]) -> Tensor:
    """Mean squared second difference along time of the time planes."""
    return _mean_square([plane.diff(2, 0) for plane in _of_time(planes)])


def time_change(planes: dict[str, Tensor]) -> Tensor:
    """Mean of |1 − P| over the time planes P; where it is 0, features do not depend on time."""
    return torch.cat([(1 - plane).abs().flatten() for plane in _of_time(planes)]).mean()


def _of_time(planes: dict[str, Tensor]) -> list[Tensor]:
    return [plane for name, plane in planes.items() if name[:2] in TIME_PLANES]


def _mean_square(differences: list[Tensor]) -> Tensor:
    """Mean square of all values; 0 without any, as for second differences of two times."""
    values = torch.cat([difference.flatten() for difference in differences])
    return values.square().sum() / max(len(values), 1)
