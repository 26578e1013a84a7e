"""Where the making of an avatar leaves its files, all of them in the person's folder."""

from dataclasses import dataclass
from pathlib import Path

from ico3d.recording.keeping.person import MAKING


@dataclass(frozen=True)
class Places:
    """Files of the making.

    Attributes:
        person: Folder of the person.
    """

    person: Path

    @property
    def folder(self) -> Path:
        """Where everything on the way lies."""
        return self.person / MAKING

    @property
    def joined(self) -> Path:
        """The parts as one video."""
        return self.folder / "joined.mp4"

    @property
    def joined_of(self) -> Path:
        """Which parts these were."""
        return self.folder / "joined.json"

    @property
    def made(self) -> Path:
        """The avatar as it is made anew, beside its workplace."""
        return self.folder / f"{self.person.name}.ico3d"

    @property
    def work(self) -> Path:
        """The workplace of `ico3d create`."""
        return self.made.with_suffix(".work")

    @property
    def avatar(self) -> Path:
        """The finished avatar, which stays until a new one is complete."""
        return self.person / self.made.name
