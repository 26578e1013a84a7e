"""What the pictures of a video tell: light, sharpness, the face's place, its turns, the camera."""

from collections.abc import Callable, Iterator

import numpy as np

from ico3d.creating.looking.advice import Advice, Level, Topic, spans_of
from ico3d.creating.looking.samples import Sample, Samples

DARK, TOO_DARK, BRIGHT = 0.25, 0.06, 0.85
"""Mean brightness of a face, 0 to 1, below or above which it should be lit otherwise."""
BURNT = 0.05
"""Share of a face that may be white."""
BLURRED = 0.12
"""Sharpness below which a face is blurred: half of it is lost where a Gaussian of 1.5 pixels has
blurred a sharp face of 240, two thirds where one of 2 has."""
SMALL = 0.3
"""Width of a face, as a share of the picture's short side, below which it should come closer."""
FEW_DEGREES = {"to the sides": 24.0, "up and down": 12.0}
"""Least range of the head's turns, degrees."""
STILL_DEGREES, STILL_JAW = 0.7, 0.02
"""Ranges of turns and of the jaw up to which nothing moves at all."""
SPEAKING = 0.08
"""Range of the jaw's opening below which nobody speaks."""
FLICKERS = 0.12
"""Largest change of a face's brightness over a video, relative to its median."""
MOVED = 0.05
"""Mean change of a picture's upper corners above which the camera, or what is there, moves."""
OFTEN = 0.1
"""Share of the pictures from which on a fault is no accident."""


def picture_advice(samples: Samples) -> Iterator[Advice]:
    """What would make the pictures better; the first that is `refused` says what is missing."""
    seen = samples.with_face
    if not seen:
        yield _no_face(samples)
        return
    yield from _of_many_faces(samples)
    yield from _where(samples, "face", lambda s: not s.faces, (
        "no face is seen: look towards the camera, and stay in the picture."
    ))  # fmt: skip
    yield from _where(samples, "frame", lambda s: bool(s.faces) and not s.inside, (
        "the face is cut off by the edge: keep all of the head in the picture, with room above it."
    ))  # fmt: skip
    yield from _where(samples, "hands", lambda s: s.hands, (
        "a hand is before the face: keep hands down, what they hide is never learnt."
    ))  # fmt: skip
    yield from _light(samples)
    yield from _sharpness(samples)
    yield from _distance(samples)
    yield from _motion(seen)
    yield from _camera(samples)


def _no_face(samples: Samples) -> Advice:
    light = float(np.median([s.light for s in samples.all]))
    dark = " The pictures are dark: turn on the light." if light < DARK else ""
    return _refused(
        "face",
        "no face is found: film one real person who looks towards the camera, at arm's length, "
        f"without a mask.{dark}",
    )


def _of_many_faces(samples: Samples) -> Iterator[Advice]:
    """Two faces: in many pictures nobody knows who is meant."""
    two = [s for s in samples.all if s.faces > 1]
    if two:
        often = len(two) > OFTEN * len(samples.all)
        text = (
            "two faces are seen: film one person alone, and cover pictures and mirrors in which "
            "faces are seen."
        )
        yield _at("faces", "refused" if often else "better", text, two, samples)


def _where(
    samples: Samples, topic: Topic, is_so: Callable[[Sample], bool], text: str
) -> Iterator[Advice]:
    """Advice with the seconds where something is so, if it is anywhere."""
    found = [s for s in samples.all if is_so(s)]
    if found:
        yield _at(topic, "better", text, found, samples)


def _light(samples: Samples) -> Iterator[Advice]:
    seen = samples.with_face
    median = float(np.median([s.light for s in seen]))
    if median < TOO_DARK:
        yield _refused("light", "it is too dark to see the face: turn on the light, face a window.")
        return
    yield from _where(samples, "light", lambda s: bool(s.faces) and s.light < DARK, (
        "the face is dark: sit facing a window or a lamp, not with your back to it."
    ))  # fmt: skip
    yield from _where(samples, "light", lambda s: s.burnt > BURNT or s.light > BRIGHT, (
        "parts of the face are white: dim the light, or move away from it."
    ))  # fmt: skip
    changed = [s for s in seen if abs(s.light / median - 1) > FLICKERS]
    if changed:
        text = (
            "the brightness changes: lock the exposure (on phones: hold a finger on the face), "
            "and let no screen or passing cloud be the light."
        )
        yield _at("exposure", "better", text, changed, samples)


def _sharpness(samples: Samples) -> Iterator[Advice]:
    yield from _where(samples, "blur", lambda s: bool(s.faces) and s.sharpness < BLURRED, (
        "the face is blurred: wipe the lens, give it light and time to focus, move slowly."
    ))  # fmt: skip


def _distance(samples: Samples) -> Iterator[Advice]:
    share = float(np.median([s.width for s in samples.with_face])) / samples.size
    if share < SMALL:
        text = (
            f"the face is small, {100 * share:.0f} % of the picture's short side: come closer "
            f"until it fills {100 * SMALL:.0f} to 50 %."
        )
        yield Advice("distance", "better", text)


def _motion(seen: tuple[Sample, ...]) -> Iterator[Advice]:
    """Turns and lips; where neither moves, it is a photograph that was filmed."""
    turns = np.ptp(np.array([s.turn for s in seen]), axis=0)  # (2,)
    jaw = float(np.ptp([s.jaw for s in seen]))
    if turns.max() < STILL_DEGREES and jaw < STILL_JAW:
        yield _refused(
            "lips",
            "nothing moves in the face, as in a photograph: film yourself while you talk and turn "
            "your head.",
        )
        return
    for (way, least), range_ in zip(FEW_DEGREES.items(), turns, strict=True):
        if range_ < least:
            yield Advice(
                "turns",
                "better",
                f"the head turns {way} by {range_:.0f}° in all: look slowly {way} while you talk, "
                "as the avatar is blurred where it was not seen.",
            )
    if jaw < SPEAKING:
        yield Advice("lips", "better", "the lips hardly move: read something aloud.")


def _camera(samples: Samples) -> Iterator[Advice]:
    corners = np.stack([s.corners for s in samples.all])  # (S, 2, 8, 8)
    away = np.abs(corners - np.median(corners, axis=0)).mean((1, 2, 3))  # (S,)
    moved = [s for s, change in zip(samples.all, away, strict=True) if change > MOVED]
    if moved:
        text = (
            "the camera or the background moves: put the phone or laptop on something firm, and "
            "let nobody walk behind you."
        )
        yield _at("camera", "better", text, moved, samples)


def _refused(topic: Topic, text: str) -> Advice:
    return Advice(topic, "refused", text)


def _at(topic: Topic, level: Level, text: str, found: list[Sample], samples: Samples) -> Advice:
    """Advice about some pictures; about nearly all of them it needs no seconds."""
    if len(found) > 0.9 * len(samples.all):
        return Advice(topic, level, text)
    spans = spans_of([s.second for s in found], 2.5 * samples.apart)
    return Advice(topic, level, text, spans)
