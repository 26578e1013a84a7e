"""Which reader opens which capture; each is imported only when its format is met."""

from collections.abc import Callable
from pathlib import Path

from ico3d.capture.capture import Capture


def _portrait(path: Path) -> Capture:
    """Opens a talking-portrait folder."""
    from ico3d.capture.talking_portrait import TalkingPortrait

    return TalkingPortrait(path)


def _synthetic(path: Path) -> Capture:
    """Opens a synthetic capture."""
    from ico3d.capture.synthetic.reader import SyntheticCapture

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
    return lambda path: (path / name).is_file()


FORMATS: list[tuple[Callable[[Path], bool], Callable[[Path], Capture]]] = [
    (_holds("transforms_train.json"), _portrait),
    (_holds("capture.json"), _synthetic),
    (_holds("cameras.json"), _multiview),
    (_is_renderme, _renderme),
    (_is_dna, _dna),
]
"""Pairs of (recognises a path, opens it); SMC files of other names are DNA-Rendering's."""
