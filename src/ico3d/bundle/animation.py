"""`animation.json`: where a body rests, and at which frames its motion may turn around.

Both are frames of the recorded clip (paper, section "Procedural Body Animation"): the rest loop
plays start … end back and forth, and whoever speaks goes from action to action.
"""

import json
from dataclasses import dataclass
from typing import Any, cast

from ico3d.bundle.manifest import BodyInfo
from ico3d.bundle.skinned.info import SkinnedInfo
from ico3d.common.typed import Rules, fill, parse_json, plain
from ico3d.errors import BundleError

ANIMATION = "animation.json"
VERSION = 1
MAX_BYTES = 1 << 20
MAX_FRAMES = 1_000_000
FASTEST = 4.0
"""Captured seconds per second that `max_speed` may be."""

MOST_NAMED = 8
"""Actions that can be asked for by name."""


@dataclass(frozen=True)
class Rest:
    """The loop of somebody who waits: frames start … end, both inside, back and forth.

    Attributes:
        start: First frame of the loop.
        end: Last frame of the loop, where every speech ends.
    """

    start: int
    end: int


@dataclass(frozen=True)
class Action:
    """A frame at which the hands stand still for a moment, away from where they rest.

    Attributes:
        frame: Motion may turn around here, or be held.
        score: How well it serves, 0 to 1: those with higher scores are visited more often.
    """

    frame: int
    score: float


@dataclass(frozen=True)
class Animation:
    """How a body moves when nobody recorded what it shall do.

    Attributes:
        fps: Frames per second of the body; frame i is at i / fps seconds of body time.
        num_frames: Of the body.
        rest: The loop of somebody who waits.
        actions: Key frames of gestures.
        min_speed: Captured seconds per second that motion lasts at least, but for easing.
        max_speed: Captured seconds per second at most.
        quality: PSNR in dB of the worst part of the body in each frame, as far as somebody
            measured it; empty where nobody did.
        version: Of the file.
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
        _require(0 < self.fps <= 1000, "fps", "lie between 0 and 1000")
        _require(2 <= last + 1 <= MAX_FRAMES, "num_frames", f"lie between 2 and {MAX_FRAMES}")
        _require(0 <= self.rest.start < last, "rest.start", f"lie between 0 and {last - 1}")
        inside = self.rest.start < self.rest.end <= last
        _require(inside, "rest.end", f"lie between {self.rest.start + 1} and {last}")
        frames = [action.frame for action in self.actions]
        for index, action in enumerate(self.actions):
            where = f"actions[{index}]"
            _require(0 <= action.frame <= last, f"{where}.frame", f"lie between 0 and {last}")
            _require(action.frame not in frames[:index], f"{where}.frame", "be there only once")
            _require(0 <= action.score <= 1, f"{where}.score", "lie between 0 and 1")
        _require(0 < self.min_speed <= FASTEST, "min_speed", f"lie between 0 and {FASTEST:g}")
        inside = self.min_speed <= self.max_speed <= FASTEST
        _require(inside, "max_speed", f"lie between min_speed and {FASTEST:g}")
        known = len(self.quality) in (0, self.num_frames)
        _require(known, "quality", f"have {self.num_frames} entries, or none")

    def to_bytes(self) -> bytes:
        """The content of `animation.json`, the same bytes for the same animation."""
        values = plain(self)
        names = [name for name in _ORDER if name != "quality" or self.quality]
        lines = [f" {json.dumps(name)}: {json.dumps(values[name])}" for name in names]
        return ("{\n" + ",\n".join(lines) + "\n}\n").encode()

    @staticmethod
    def from_bytes(data: bytes) -> "Animation":
        """Reads and checks an animation.

        Raises:
            BundleError: In one sentence, if it is none or makes no sense.
        """
        _require(len(data) <= MAX_BYTES, "it", f"have at most {MAX_BYTES} bytes")
        values = parse_json(data, ANIMATION, BundleError)
        if isinstance(values, dict):
            cast(dict[str, Any], values).setdefault("quality", [])  # older bundles have none
        return fill(Animation, values, ANIMATION, Rules(BundleError))

    def check_body(self, body: BodyInfo | SkinnedInfo) -> None:
        """Checks that this is the animation of a body.

        Raises:
            BundleError: If the frames are others.
        """
        _require(self.fps == body.fps, "fps", f"be the body's, {body.fps:g}")
        frames = body.num_frames
        _require(self.num_frames == frames, "num_frames", f"be the body's, {frames}")

    @property
    def gestures(self) -> dict[str, float]:
        """Seconds of body time of the best actions by name: `gesture-1` is the very best."""
        ranked = sorted(self.actions, key=lambda action: (-action.score, action.frame))
        best = enumerate(ranked[:MOST_NAMED], 1)
        return {f"gesture-{rank}": action.frame / self.fps for rank, action in best}

    @property
    def seconds(self) -> float:
        """Body time of the last frame."""
        return (self.num_frames - 1) / self.fps


_ORDER = ("version", "fps", "num_frames", "rest", "actions", "min_speed", "max_speed", "quality")
"""Of the entries in the file."""


def _require(holds: bool, where: str, what: str) -> None:
    if not holds:
        raise BundleError(f"{ANIMATION}: {where} must {what}.")
