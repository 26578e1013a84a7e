"""What a manifest says of a body of windows."""

from dataclasses import dataclass

from ico3d.bundle import limits
from ico3d.bundle.limits import Require


@dataclass(frozen=True)
class WindowInfo:
    """A window: a span of the body's frames that has its own Gaussians.

    Attributes:
        first: First frame; it is also the last frame of the previous window.
        last: Last frame.
        num_gaussians: N, number of Gaussians.
        num_clusters: C, number of groups of Gaussians with coefficients of their own.
        ranks: P, R, L: numbers of basis vectors of positions, rotations and scales.
        file: Name of the window's file: `body/0000.safetensors` and so on.
    """

    first: int
    last: int
    num_gaussians: int
    num_clusters: int
    ranks: tuple[int, int, int]
    file: str


@dataclass(frozen=True)
class BodyInfo:
    """A body of windows: the counts that the windows' tensors must agree with.

    Attributes:
        fps: Frames per second; frame i is at i / fps seconds.
        samples_per_frame: Sampled times per frame: S = samples_per_frame · (last − first) + 1.
        low: Lower corner of the box that the Gaussians' centres stay in, metres.
        high: Upper corner of that box, metres.
        windows: Windows in order of time, without gaps.
    """

    fps: float
    samples_per_frame: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    windows: tuple[WindowInfo, ...]

    def num_samples(self, window: WindowInfo) -> int:
        """S, the number of sampled times of a window."""
        return self.samples_per_frame * (window.last - window.first) + 1

    @property
    def num_frames(self) -> int:
        """F, the number of frames of the whole clip."""
        return self.windows[-1].last + 1


def window_file(index: int) -> str:
    """Name of the file of window `index`."""
    return f"body/{index:04}.safetensors"


def check_body(body: BodyInfo, require: Require) -> None:
    """Checks the counts of a body of windows.

    Args:
        body: The entry of a manifest.
        require: Called for each check; it raises the error.
    """
    require(limits.MIN_FPS <= body.fps <= limits.MAX_FPS, "body.fps", limits.FPS_RANGE)
    top = limits.MAX_SAMPLES_PER_FRAME
    inside = 1 <= body.samples_per_frame <= top
    require(inside, "body.samples_per_frame", f"lie between 1 and {top}")
    ordered = all(a <= b for a, b in zip(body.low, body.high, strict=True))
    require(ordered, "body.low", "be at most body.high")
    require(len(body.windows) > 0, "body.windows", "hold one at least")
    for index in range(len(body.windows)):
        _check_window(body, index, require)
    most = [max(ranks) for ranks in zip(*(window.ranks for window in body.windows), strict=True)]
    room = (1 + sum(most)) * max(window.num_gaussians for window in body.windows)
    _bound(room, "body.windows", "most Gaussians × (1 + most ranks)", require)


def _check_window(body: BodyInfo, index: int, require: Require) -> None:
    window = body.windows[index]
    where = f"body.windows[{index}]"
    require(window.file == window_file(index), f"{where}.file", f"be {window_file(index)}")
    most = {"num_gaussians": limits.MAX_GAUSSIANS, "num_clusters": limits.MAX_CLUSTERS}
    for name, top in most.items():
        require(1 <= getattr(window, name) <= top, f"{where}.{name}", f"lie between 1 and {top}")
    top = limits.MAX_BODY_RANK
    inside = all(1 <= rank <= top for rank in window.ranks)
    require(inside, f"{where}.ranks", f"lie between 1 and {top}")
    length, top = window.last - window.first, limits.MAX_WINDOW_FRAMES
    require(1 <= length <= top, f"{where}.last", f"be 1 to {top} frames after its first")
    times = body.num_samples(window)
    require(times >= 3, f"{where}.last", "leave three sampled times")
    curves = times * window.num_clusters * sum(window.ranks)
    _bound(curves, f"{where}.num_clusters", "times × clusters × ranks", require)
    begins = body.windows[index - 1].last if index else 0
    require(window.first == begins, f"{where}.first", f"be {begins}")


def _bound(product: int, where: str, what: str, require: Require) -> None:
    most = limits.MAX_MOVED
    require(product <= most, where, f"be less: {what} may be {most}, not {product}")
