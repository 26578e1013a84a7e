"""What of a stand-in's body can be chosen: build and outfit."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ico3d.avatar.embodying.builds.names import MEDIUM, BuildName
from ico3d.bundle.people.provenance import Part
from ico3d.errors import SettingsError

OutfitName = Literal["recorded", "navy", "wine"]
AS_RECORDED: OutfitName = "recorded"
"""The clothes of a body as they were recorded."""


@dataclass(frozen=True)
class Look:
    """How a body is to look.

    Attributes:
        build: The build; `medium` is the one that was recorded.
        outfit: The colours of the clothes; `recorded` are those that were.
    """

    build: BuildName = MEDIUM
    outfit: OutfitName = AS_RECORDED

    def told(self, kind: str, likeness: str) -> Part:
        """What a bundle says of such a body: what is as recorded is not said.

        Args:
            kind: Kind of the body's recordings.
            likeness: Whose likeness it is.
        """
        build, outfit = (
            "" if one in (MEDIUM, AS_RECORDED) else one for one in (self.build, self.outfit)
        )
        return Part("body", kind, likeness, build, outfit)


UNCHANGED = Look()
"""The look of a body as it was recorded."""


def check_look(body: Path | None, look: Look) -> None:
    """Refuses a look of a body that is not there.

    Args:
        body: The body; None where a head is to stay alone.
        look: How it is to look.

    Raises:
        SettingsError: If the head stays alone and the look is other than as recorded.
    """
    if body is None and look != UNCHANGED:
        raise SettingsError(
            "--build and --outfit are those of a stand-in's body: say which one by --body, such as "
            "--body demo."
        )
