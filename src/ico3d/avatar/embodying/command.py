"""The verb `ico3d embody`."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from ico3d.avatar.embodying.builds.names import MEDIUM, BuildName
from ico3d.avatar.embodying.look import AS_RECORDED, Look, OutfitName
from ico3d.bundle.packaged import NAME


@dataclass(frozen=True)
class Embody:
    """Makes a whole person of a head alone: the body of another person stands in for their own.

    The head is fitted to the body in place and size, the body's skin and hair take its colours.
    The bundle says, and the page shows, which part is whose.

    Attributes:
        head: The avatar whose head, voice and persona are kept, NAME.ico3d.
        out: The bundle to write.
        body: A whole person on a skeleton; `demo` is the avatar of the package.
        build: Build of the body; `medium` is the one that was recorded.
        outfit: Colours of its clothes; `recorded` are those that were.
    """

    head: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    body: Path = Path(NAME)
    build: BuildName = MEDIUM
    outfit: OutfitName = AS_RECORDED

    def run(self) -> None:
        """Fits, colours, writes and checks the bundle.

        Raises:
            Ico3dError: As for `embody`.
        """
        from rich.console import Console

        from ico3d.avatar.embodying.embody import embody
        from ico3d.bundle.format import Bundle
        from ico3d.errors import printable

        console = Console()
        look = Look(self.build, self.outfit)
        embody(Bundle.open(self.head), Bundle.open(self.body), self.out, console.print, look)
        Bundle.open(self.out)
        size = self.out.stat().st_size
        console.print(printable(f"{self.out}: {size / 1e6:.2f} MB."), markup=False)
