"""Which body somebody's avatar is to get, kept with the recording."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

from ico3d.avatar.embodying.builds.names import BuildName
from ico3d.avatar.embodying.look import UNCHANGED, Look, OutfitName
from ico3d.common.files import write_atomic
from ico3d.common.typed import plain
from ico3d.recording.keeping.noted import noted
from ico3d.recording.refusals import Refused

FILE = "body.json"
BUILDS: tuple[BuildName, ...] = get_args(BuildName)
OUTFITS: tuple[OutfitName, ...] = get_args(OutfitName)


@dataclass(frozen=True)
class BodyChoice:
    """Which body an avatar gets.

    Attributes:
        wanted: Whether it gets a body that stands in; else it is a head with shoulders.
        look: Build and outfit of that body.
    """

    wanted: bool = False
    look: Look = UNCHANGED


HEAD_ALONE = BodyChoice()


def chosen(form: dict[str, Any]) -> BodyChoice:
    """The choice in a form of the page.

    Raises:
        Refused: If there is no such body.
    """
    wanted, build, outfit = form.get("wanted"), form.get("build"), form.get("outfit")
    if not isinstance(wanted, bool) or build not in BUILDS or outfit not in OUTFITS:
        raise Refused("body", "there is no such body: choose one of those that are shown.")
    return BodyChoice(wanted, Look(cast(BuildName, build), cast(OutfitName, outfit)))


def read_choice(person: Path, default: BodyChoice) -> BodyChoice:
    """What was chosen for somebody; the default where nothing was.

    Args:
        person: Their folder.
        default: What counts as long as they did not choose.
    """
    try:
        return chosen(noted(person / FILE))
    except (OSError, ValueError, AttributeError, Refused):
        return default


def write_choice(person: Path, choice: BodyChoice) -> None:
    """Keeps the choice with somebody's recording.

    Raises:
        StorageError: If the disk is full.
    """
    write_atomic(person / FILE, json.dumps(as_form(choice), indent=1).encode())


def as_form(choice: BodyChoice) -> dict[str, Any]:
    """A choice as the page has it."""
    return {"wanted": choice.wanted} | plain(choice.look)
