"""What a page needs to move somebody, as one file: their figure and their gestures."""

import json
from typing import Any, cast

import numpy as np
from safetensors.numpy import save

from ico3d.common.typed import parse_json
from ico3d.errors import SettingsError
from ico3d.motion.clip import Clip, from_bytes, header_of, meaning, other_hand, tensors_of
from ico3d.motion.figure import NEAR, alike, figure_of
from ico3d.motion.living import Living, living
from ico3d.motion.roles import ROLES
from ico3d.rig.quaternions import Array
from ico3d.rig.rig import Rig


def preferring(recorded: dict[str, Clip], others: dict[str, Clip]) -> dict[str, Clip]:
    """All that somebody recorded, and of other clips those that mean something else.

    A beat that was recorded with one hand stands for that of the other hand, too: composers mirror
    it.
    """
    meant = {meaning(name) for name in recorded}
    meant |= {other_hand(name) for name in meant}
    return recorded | {name: clip for name, clip in others.items() if name not in meant}


def repertoire_bytes(somebody: Living, clips: dict[str, Clip], cuts: str = "") -> bytes:
    """A safetensors file: clips as `clip.to_bytes` has them, the figure as JSON in the header.

    Args:
        somebody: Of the rig as the page has it, whose joints may have been rounded.
        clips: By name.
        cuts: Which frames of the recording they are of (`recorded.cut.to_toml`), for people.
    """
    figure = json.dumps(figure_of(somebody))
    return save(tensors_of(clips), {"clips": header_of(clips), "figure": figure, "cuts": cuts})


def clips_for(content: bytes, rig: Rig) -> dict[str, Clip]:
    """The clips of a file that was written for a rig.

    Raises:
        SettingsError: If the file is damaged, or its figure is not that of the rig.
    """
    clips = from_bytes(content)  # it is sound from here on, but for the figure
    if not alike(figure_of(living(rig, 0, hung_of(content))), _figure(content)):
        raise SettingsError("the file of gestures was made for another rig.")
    return clips


def hung_of(content: bytes) -> Array:
    """(R, 4) by role: how arms hang, of a sound file but for its figure.

    Raises:
        SettingsError: If its figure does not say so in rotations.
    """
    figure = _figure(content)
    try:
        hung = np.array(cast(dict[str, Any], figure)["hung"], np.float64)
    except (TypeError, KeyError, ValueError, OverflowError):
        hung = np.zeros(0)
    turned = hung.shape == (len(ROLES), 4)
    if not turned or not (np.abs(np.linalg.norm(hung, axis=-1) - 1) < NEAR).all():
        raise SettingsError("the file of gestures does not say how arms hang.")
    return hung


def _figure(content: bytes) -> Any:
    try:
        return parse_json(_metadata(content, "figure").encode(), "the figure", ValueError)
    except ValueError as error:
        raise SettingsError("the file of gestures tells no figure.") from error


def cuts_text(content: bytes) -> str:
    """Which frames of a recording the clips of a sound file are of; empty where nobody says."""
    return _metadata(content, "cuts")


def _metadata(content: bytes, name: str) -> str:
    """A text in the header of a safetensors file; empty where there is none."""
    size = int.from_bytes(content[:8], "little")
    header = cast(dict[str, Any], json.loads(content[8 : 8 + size]))
    return header["__metadata__"].get(name, "")
