"""The file with which a page moves a person: the person's figure and gestures."""

import json
from dataclasses import replace
from typing import Any, cast

import numpy as np
from safetensors.numpy import save

from ico3d.common.typed import parse_json
from ico3d.errors import SettingsError
from ico3d.motion.clip import Clip, from_bytes, header_of, meaning, other_hand, tensors_of, texts_of
from ico3d.motion.figure import NEAR, alike, figure_of
from ico3d.motion.living import Living, living
from ico3d.motion.roles import ROLES
from ico3d.motion.standing import APART_BEFORE, stance_of
from ico3d.rig.quaternions import Array
from ico3d.rig.rig import Rig


def preferring(recorded: dict[str, Clip], others: dict[str, Clip]) -> dict[str, Clip]:
    """Recorded clips, and those other clips whose meaning no recorded clip has.

    A gesture recorded with one hand replaces that of the other hand, too: composers mirror it.

    Args:
        recorded: Clips by name, which are all kept.
        others: Clips by name.
    """
    meant = {meaning(name) for name in recorded}
    meant |= {other_hand(name) for name in meant}
    return recorded | {name: clip for name, clip in others.items() if meaning(name) not in meant}


def repertoire_bytes(somebody: Living, clips: dict[str, Clip], cuts: str = "") -> bytes:
    """A safetensors file of clips (as by `clip.to_bytes`), with the figure as JSON in its header.

    Args:
        somebody: The person, with the rig as the page has it: its joints may have been rounded.
        clips: Clips by name.
        cuts: Text of `recorded.cut.to_toml`, which says from which frames clips were made.
    """
    figure = json.dumps(figure_of(somebody))
    return save(tensors_of(clips), {"clips": header_of(clips), "figure": figure, "cuts": cuts})


def clips_for(content: bytes, rig: Rig) -> dict[str, Clip]:
    """The clips, by name, of a file that was written for a rig.

    Args:
        content: Content of the file.
        rig: The rig, whose figure the file must have.

    Raises:
        SettingsError: If the file is damaged, or its figure is not that of the rig.
    """
    clips = from_bytes(content)  # raises for a damaged file; the figure is checked below
    somebody, figure = living(rig, 0, hung_of(content)), _figure(content)
    before = replace(somebody, stance=stance_of(somebody.person, APART_BEFORE))
    if not any(alike(figure_of(one), figure) for one in (somebody, before)):
        raise SettingsError("the file of gestures was made for another rig.")
    return clips


def hung_of(content: bytes) -> Array:
    """(R, 4) pose by role with hanging arms, from the figure in a file of `repertoire_bytes`.

    Raises:
        SettingsError: If the file has no figure with such rotations.
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
        return parse_json(texts_of(content).get("figure", "").encode(), "the figure", ValueError)
    except ValueError as error:
        raise SettingsError("the file of gestures tells no figure.") from error


def cuts_text(content: bytes) -> str:
    """The text of cuts in a file of `repertoire_bytes`; empty where it has none."""
    return texts_of(content).get("cuts", "")
