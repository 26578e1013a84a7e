"""`animation.json`: the frames at which a body rests, and at which its motion may turn around.

All frames are those of the recorded clip (paper, section "Procedural Body Animation"). At rest the
frames start … end are played back and forth; during speech the body moves from one action to
another.
"""

import json
from dataclasses import dataclass
from typing import Any, cast

from ico3d.bundle import limits
from ico3d.bundle.skinned.info import SkinnedInfo
from ico3d.bundle.windows.info import BodyInfo
from ico3d.common.typed import Rules, fill, parse_json, plain
from ico3d.errors import BundleError

ANIMATION = "animation.json"
VERSION = 1
MAX_BYTES = 1 << 20
MAX_FRAMES = 1_000_000
MAX_ACTIONS = 1000
SLOWEST, FASTEST = 0.05, 4.0
"""Lowest value of `min_speed` and highest of `max_speed`, captured seconds per second."""

MOST_NAMED = 8
"""Number of actions that have names and can be asked for."""


@dataclass(frozen=True)
class Rest:
    """The resting loop: frames start … end, both included, played back and forth.

    Attributes:
        start: First frame of the loop.
        end: Last frame of the loop, where every speech ends.
    """

    start: int
    end: int


@dataclass(frozen=True)
class Action:
    """A frame at which the hands stand still for a moment, away from their resting place.

    Attributes:
        frame: Frame at which motion may pause or turn around.
        score: Suitability, 0 to 1; actions with higher scores are visited more often.
    """

    frame: int
    score: float


@dataclass(frozen=True)
class Animation:
    """How a body moves procedurally, by replaying parts of the recorded clip.

    Attributes:
        fps: Frames per second of the body; frame i is at i / fps seconds of body time.
        num_frames: Number of frames of the body.
        rest: The resting loop.
        actions: Frames at which motion may pause or turn around.
        min_speed: Lowest speed of motion, captured seconds per second, except while easing.
        max_speed: Highest speed of motion, captured seconds per second.
        quality: PSNR in dB of the worst part of the body in each frame; empty if it was not
            measured.
        version: Version of the file format.
    """

    fps: float
    num_frames: int
    rest: Rest
    actions: tuple[Action, ...]
    min_speed: float = 0.6
    max_speed: float = 1.2
    quality: tuple[float, ...] = ()
    version: int = VERSION

    def __post_init__(self):
        """Checks ranges.

        Raises:
            BundleError: Naming the first entry that makes no sense.
        """
        last = self.num_frames - 1
        _require(self.version == VERSION, "version", f"be {VERSION}")
        inside = limits.MIN_FPS <= self.fps <= limits.MAX_FPS
        _require(inside, "fps", limits.FPS_RANGE)
        _require(2 <= last + 1 <= MAX_FRAMES, "num_frames", f"lie between 2 and {MAX_FRAMES}")
        short = last <= limits.LONGEST * self.fps
        _require(short, "num_frames", f"last {limits.LONGEST:g} s at most")
        _require(0 <= self.rest.start < last, "rest.start", f"lie between 0 and {last - 1}")
        inside = self.rest.start < self.rest.end <= last
        _require(inside, "rest.end", f"lie between {self.rest.start + 1} and {last}")
        _require(len(self.actions) <= MAX_ACTIONS, "actions", f"be at most {MAX_ACTIONS}")
        seen: set[int] = set()
        for index, action in enumerate(self.actions):
            where = f"actions[{index}]"
            _require(0 <= action.frame <= last, f"{where}.frame", f"lie between 0 and {last}")
            _require(action.frame not in seen, f"{where}.frame", "be there only once")
            seen.add(action.frame)
            _require(0 <= action.score <= 1, f"{where}.score", "lie between 0 and 1")
        inside = SLOWEST <= self.min_speed <= FASTEST
        _require(inside, "min_speed", f"lie between {SLOWEST:g} and {FASTEST:g}")
        inside = self.min_speed <= self.max_speed <= FASTEST
        _require(inside, "max_speed", f"lie between min_speed and {FASTEST:g}")
        known = len(self.quality) in (0, self.num_frames)
        _require(known, "quality", f"have {self.num_frames} entries, or none")

    def to_bytes(self) -> bytes:
        """The content of `animation.json`; equal animations give equal bytes."""
        values = plain(self)
        names = [name for name in _ORDER if name != "quality" or self.quality]
        lines = [f" {json.dumps(name)}: {json.dumps(values[name])}" for name in names]
        return ("{\n" + ",\n".join(lines) + "\n}\n").encode()

    @staticmethod
    def from_bytes(data: bytes) -> "Animation":
        """Reads and checks the content of `animation.json`.

        Raises:
            BundleError: If the content is malformed or contradicts itself.
        """
        _require(len(data) <= MAX_BYTES, "it", f"have at most {MAX_BYTES} bytes")
        values = parse_json(data, ANIMATION, BundleError)
        if isinstance(values, dict):
            cast(dict[str, Any], values).setdefault("quality", [])  # older bundles have none
        return fill(Animation, values, ANIMATION, Rules(BundleError))

    def check_body(self, body: BodyInfo | SkinnedInfo) -> None:
        """Checks that this animation belongs to a body.

        Raises:
            BundleError: If the number or the rate of the frames differ.
        """
        _require(self.fps == body.fps, "fps", f"be the body's, {body.fps:g}")
        frames = body.num_frames
        _require(self.num_frames == frames, "num_frames", f"be the body's, {frames}")

    @property
    def gestures(self) -> dict[str, float]:
        """Body time in seconds of the best actions, by name; `gesture-1` has the highest score."""
        ranked = sorted(self.actions, key=lambda action: (-action.score, action.frame))
        best = enumerate(ranked[:MOST_NAMED], 1)
        return {f"gesture-{rank}": action.frame / self.fps for rank, action in best}

    @property
    def seconds(self) -> float:
        """Body time of the last frame, seconds."""
        return (self.num_frames - 1) / self.fps


_ORDER = ("version", "fps", "num_frames", "rest", "actions", "min_speed", "max_speed", "quality")
"""Of the entries in the file."""


def _require(holds: bool, where: str, what: str) -> None:
    if not holds:
        raise BundleError(f"{ANIMATION}: {where} must {what}.")
