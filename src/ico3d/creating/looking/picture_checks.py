"""What the pictures of a video tell: light, sharpness, the face's place, its turns, the camera."""

from collections.abc import Callable, Iterator

import numpy as np

from ico3d.creating.looking.advice import Advice, Level, spans_of
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
FEW_DEGREES = {"turns-sides": 24.0, "turns-up": 12.0}
"""Least range of the head's turns, degrees, by the code of what is said of less."""
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
    yield from _where(samples, "face-away", lambda s: not s.faces)
    yield from _where(samples, "frame", lambda s: bool(s.faces) and not s.inside)
    yield from _where(samples, "hands", lambda s: s.hands)
    yield from _light(samples)
    yield from _sharpness(samples)
    yield from _distance(samples)
    yield from _motion(seen)
    yield from _camera(samples)


def _no_face(samples: Samples) -> Advice:
    light = float(np.median([s.light for s in samples.all]))
    return Advice("face-dark" if light < DARK else "face-none", "refused")


def _of_many_faces(samples: Samples) -> Iterator[Advice]:
    """Two faces: in many pictures nobody knows who is meant."""
    two = [s for s in samples.all if s.faces > 1]
    if two:
        often = len(two) > OFTEN * len(samples.all)
        yield _at("faces", "refused" if often else "better", two, samples)


def _where(samples: Samples, code: str, is_so: Callable[[Sample], bool]) -> Iterator[Advice]:
    """Advice with the seconds where something is so, if it is anywhere."""
    found = [s for s in samples.all if is_so(s)]
    if found:
        yield _at(code, "better", found, samples)


def _light(samples: Samples) -> Iterator[Advice]:
    seen = samples.with_face
    median = float(np.median([s.light for s in seen]))
    if median < TOO_DARK:
        yield Advice("light-none", "refused")
        return
    yield from _where(samples, "light-dark", lambda s: bool(s.faces) and s.light < DARK)
    yield from _where(samples, "light-white", lambda s: s.burnt > BURNT or s.light > BRIGHT)
    changed = [s for s in seen if abs(s.light / median - 1) > FLICKERS]
    if changed:
        yield _at("exposure", "better", changed, samples)


def _sharpness(samples: Samples) -> Iterator[Advice]:
    yield from _where(samples, "blur", lambda s: bool(s.faces) and s.sharpness < BLURRED)


def _distance(samples: Samples) -> Iterator[Advice]:
    share = float(np.median([s.width for s in samples.with_face])) / samples.size
    if share < SMALL:
        values = {"share": round(100 * share), "least": round(100 * SMALL)}
        yield Advice("distance", "better", values)


def _motion(seen: tuple[Sample, ...]) -> Iterator[Advice]:
    """Turns and lips; where neither moves, it is a photograph that was filmed."""
    turns = np.ptp(np.array([s.turn for s in seen]), axis=0)  # (2,)
    jaw = float(np.ptp([s.jaw for s in seen]))
    if turns.max() < STILL_DEGREES and jaw < STILL_JAW:
        yield Advice("lips-photograph", "refused")
        return
    for (code, least), range_ in zip(FEW_DEGREES.items(), turns, strict=True):
        if range_ < least:
            yield Advice(code, "better", {"n": round(float(range_))})
    if jaw < SPEAKING:
        yield Advice("lips-still")


def _camera(samples: Samples) -> Iterator[Advice]:
    corners = np.stack([s.corners for s in samples.all])  # (S, 2, 8, 8)
    away = np.abs(corners - np.median(corners, axis=0)).mean((1, 2, 3))  # (S,)
    moved = [s for s, change in zip(samples.all, away, strict=True) if change > MOVED]
    if moved:
        yield _at("camera", "better", moved, samples)


def _at(code: str, level: Level, found: list[Sample], samples: Samples) -> Advice:
    """Advice about some pictures; about nearly all of them it needs no seconds."""
    if len(found) > 0.9 * len(samples.all):
        return Advice(code, level)
    return Advice(code, level, {}, spans_of([s.second for s in found], 2.5 * samples.apart))
