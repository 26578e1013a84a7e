"""Contact sheet of an animation: its key frames, and the speed of the hands."""

from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from rich.progress import track

from ico3d.avatar.animation import clip_sheet
from ico3d.avatar.animation.animated import Person
from ico3d.avatar.animation.keyframes import Motion
from ico3d.avatar.animation.motion_quality import least_quality
from ico3d.avatar.animation.strokes import filled, strokes
from ico3d.avatar.camera_path import Ring, orbit, ring_around, ring_of
from ico3d.avatar.moving import extent
from ico3d.avatar.staging import NEUTRAL
from ico3d.bundle.animation import Action, Animation
from ico3d.common.camera import Camera
from ico3d.common.files import write_atomic
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 300, 500
"""Width and height in pixels of a picture of the person."""
MOST = 16
"""Largest number of played actions, and of refused ones, that are shown: the best by score."""
COLUMNS = 6
REST, ACTION, REFUSED, MADE = "tab:blue", "tab:orange", "tab:red", "tab:green"


def draw_sheet(
    person: Person,
    animation: Animation,
    motion: Motion,
    left_out: Sequence[Action],
    cameras: Sequence[Camera] | None,
    path: Path,
    clips: clip_sheet.Named = (),
) -> None:
    """Draws an animation into a picture file.

    At the top is a chart of the hands' speed, with the rest loop and the actions marked, and one of
    the frames' quality where it was measured. Below are pictures from the front: the person at the
    key frames, in order of time; on a skeleton, at the strokes of all gestures; and a row for each
    recorded clip.

    Args:
        person: Who is animated.
        animation: The rest loop and the actions.
        motion: How the person moves.
        left_out: Actions that are refused.
        cameras: Cameras of the recording; pictures are from the side of the first one. None shows
            the person from its own front or, where that is unknown, from +z in a world with y up.
        path: NAME.jpg or NAME.png.
        clips: Recorded clips with their names.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = key_frames(animation, left_out)
    poseable = person.poseable
    gestures = len(poseable.clips) if poseable else 0
    rows = -(-(len(shown) + gestures) // COLUMNS)
    curves = 2 if animation.quality else 1
    heights = [3 * curves, 3.6 * rows, *([clip_sheet.height(clips)] if clips else [])]
    figure = Figure(figsize=(12, sum(heights)), layout="constrained")
    FigureCanvasAgg(figure)
    above, below, *lowest = figure.subfigures(len(heights), 1, height_ratios=heights)  # type: ignore
    charts = above.subplots(curves, 1, squeeze=False).ravel()
    _speed(charts[0], animation, motion)
    clip_sheet.mark(charts[0], clips)
    if animation.quality:
        _quality(charts[1], animation)
    places = below.subplots(rows, COLUMNS, squeeze=False).ravel()
    camera = front(person, cameras)
    for place in places:
        place.set(xticks=(), yticks=())  # ticks of hidden axes would take room in the layout
        place.axis("off")
    moments = ((name, person.gaussians(at / animation.fps)) for at, name in shown.items())
    made = strokes(poseable, person.idle) if poseable else ()
    drawn = track(chain(moments, made), "drawing", len(shown) + gestures, transient=True)
    for place, (label, gaussians) in zip(places, drawn, strict=False):
        place.imshow(_picture(gaussians, camera))
        place.set_title(label, fontsize=9, color=_colour(label), y=1.0)
    for place in lowest:
        clip_sheet.draw_clips(
            place, clips, lambda at: _picture(person.gaussians(at / animation.fps), camera)
        )
    kind = "png" if path.suffix.lower() == ".png" else "jpeg"
    write_atomic(path, lambda file: figure.savefig(file, format=kind, dpi=100))


def key_frames(animation: Animation, left_out: Sequence[Action] = ()) -> dict[int, str]:
    """The frames that are shown, in order of time, and the label of each."""
    labels: dict[int, list[str]] = {}
    for name, actions in (("action", animation.actions), ("refused", left_out)):
        for action in sorted(actions, key=lambda action: -action.score)[:MOST]:
            labels[action.frame] = [f"{name}, score {action.score:.2f}"]
    rest = animation.rest
    for frame, name in ((rest.start, "rest start"), (rest.end, "rest end")):
        labels.setdefault(frame, []).insert(0, name)
    return {frame: f"{frame}: {', '.join(labels[frame])}" for frame in sorted(labels)}


def _colour(label: str) -> str:
    """Colour of a picture's title, by its label: those of key frames begin with a digit."""
    if not label[0].isdigit():
        return MADE
    return REFUSED if "refused" in label else ACTION if "action" in label else REST


def front(person: Person, cameras: Sequence[Camera] | None) -> Camera:
    """A camera before the person with all of it in view, in the whole clip and in all gestures.

    Args:
        person: Who is seen.
        cameras: Cameras of the recording, the first of which decides the side; None takes the side
            to which the person looks, or +z where that is unknown.
    """
    points, poseable = extent(person), person.poseable
    if poseable:
        points = np.concatenate([points, filled(poseable, person.idle)])
    ring = ring_of(cameras, points) if cameras else ring_around(points)
    if not cameras and person.facing is not None:
        ring = _turned(ring, person.facing)
    return orbit(ring, points, 1, *SIZE)[0]


def _turned(ring: Ring, facing: np.ndarray) -> Ring:
    """A ring that begins in the direction (3,) in which a person looks, but for its height."""
    level = facing - (facing @ ring.up) * ring.up
    length = np.linalg.norm(level)
    if length < 1e-6:
        return ring
    arm = ring.start - ring.middle
    along = (arm @ ring.up) * ring.up
    start = ring.middle + along + level / length * np.linalg.norm(arm - along)
    return Ring(ring.middle, ring.up, start)


@torch.no_grad()
def _picture(gaussians: Gaussians, camera: Camera) -> np.ndarray:
    rgb = render(gaussians, [camera], torch.tensor(NEUTRAL)).rgb[0]
    return rgb.clamp(0, 1).cpu().numpy()  # (H, W, 3)


def _quality(axes: "Axes", animation: Animation) -> None:
    """Draws the quality of each frame, and marks frames that are too bad to be played."""
    bound = least_quality(animation)
    for frame, value in enumerate(animation.quality):
        if value < bound:
            axes.axvspan(frame - 0.5, frame + 0.5, color=REFUSED, alpha=0.2, lw=0)
    axes.axhline(bound, color=REFUSED, lw=1, label="least that is played")
    axes.plot(animation.quality, color="black", marker=".", lw=1)
    axes.set(
        xlim=(0, animation.num_frames - 1), xlabel="frame", ylabel="PSNR of the worst part, dB"
    )
    axes.legend(loc="lower right", fontsize=8)


def _speed(axes: "Axes", animation: Animation, motion: Motion) -> None:
    """Draws the hands' speed on a logarithmic scale, and marks the rest loop and the actions."""
    rest = animation.rest
    axes.axvspan(rest.start, rest.end, color=REST, alpha=0.2, lw=0, label="rest loop")
    for number, action in enumerate(animation.actions):
        label = None if number else "actions"
        axes.axvline(action.frame, color=ACTION, lw=1 + 2 * action.score, label=label)
        axes.annotate(
            str(action.frame),
            (action.frame, 1.0),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="bottom",
            fontsize=8,
        )
    axes.plot(motion.speeds, color="black", marker=".", lw=1)
    axes.set(
        yscale="log",
        xlim=(0, len(motion.speeds) - 1),
        xlabel="frame",
        ylabel="speed of the hands, m/s",
    )
    axes.legend(loc="lower right", fontsize=8)
