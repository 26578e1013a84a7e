"""The formats of captures; a reader is imported only when a capture of its format is opened."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ico3d.capture.capture import Capture
from ico3d.errors import CaptureError


def _portrait(path: Path) -> Capture:
    """Opens a talking-portrait folder."""
    from ico3d.capture.portrait.reader import TalkingPortrait

    return TalkingPortrait(path)


def _synthetic(path: Path) -> Capture:
    """Opens a synthetic capture."""
    from ico3d.capture.synthetic import SyntheticCapture

    return SyntheticCapture(path)


def _multiview(path: Path) -> Capture:
    """Opens a multiview folder."""
    from ico3d.capture.multiview.reader import MultiviewCapture

    return MultiviewCapture(path)


def _renderme(path: Path) -> Capture:
    """Opens a RenderMe-360 recording."""
    from ico3d.capture.renderme.reader import RenderMe360

    return RenderMe360(path)


def _is_renderme(path: Path) -> bool:
    """Recognises SMC files by their names."""
    from ico3d.capture.renderme.files import is_recording

    return is_recording(path)


def _dna(path: Path) -> Capture:
    """Opens a DNA-Rendering recording."""
    from ico3d.capture.dna.reader import DnaRendering

    return DnaRendering(path)


def _is_dna(path: Path) -> bool:
    """Recognises SMC files."""
    from ico3d.capture.dna.files import is_recording

    return is_recording(path)


def _holds(name: str) -> Callable[[Path], bool]:
    """Recognises a folder by a file in it."""
    return lambda path: os.path.isfile(path / name)


@dataclass(frozen=True)
class Format:
    """A format of captures.

    Attributes:
        name: Name of the format in errors, with the files by which it is recognised.
        recognises: Whether a path holds a capture of this format.
        read: Opens a capture.
    """

    name: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path], Capture]


FORMATS = (
    Format(
        "a talking-portrait folder (transforms_train.json)",
        _holds("transforms_train.json"),
        _portrait,
    ),
    Format("a synthetic capture (capture.json)", _holds("capture.json"), _synthetic),
    Format("a multiview folder (cameras.json)", _holds("cameras.json"), _multiview),
    Format("a RenderMe-360 recording (_raw.smc and _anno.smc)", _is_renderme, _renderme),
    Format("a DNA-Rendering recording (.smc and _annots.smc)", _is_dna, _dna),
)
"""All formats; the first one that recognises a path reads it.

SMC files of unknown names are read as DNA-Rendering.
"""


def opened_apart(capture: Capture) -> Capture:
    """The recording of an open capture with open files of its own, for another thread."""
    from ico3d.capture.multiview.reader import MultiviewCapture

    return capture.apart() if isinstance(capture, MultiviewCapture) else open_capture(capture.path)


def open_capture(path: Path | str) -> Capture:
    """Opens a capture of any format, with the tracked head if there is a track.

    Raises:
        CaptureError: If the capture is missing or damaged, or no format recognises it.
    """
    from ico3d.capture.headpose.tracked import with_track

    path = Path(path)
    for known in FORMATS:
        if known.recognises(path):
            return with_track(known.read(path))
    if not os.path.exists(path):
        raise CaptureError(f"there is no capture at {path}.")
    *names, last = (known.name for known in FORMATS)
    raise CaptureError(
        f"{path} is in no format known here: expected {', '.join(names)} or {last}; "
        "other recordings come in with ico3d capture import."
    )
