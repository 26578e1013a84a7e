"""The verb `ico3d forget`."""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

if TYPE_CHECKING:
    from ico3d.avatar.forgetting.holdings import Holding


@dataclass(frozen=True)
class Forget:
    """Removes what a project folder holds of a person, and says what remains elsewhere.

    Recordings with their tracks, models, unfinished trainings and bundles belong to a person if
    they state their likeness, or were made of something that belongs to them. All of it is listed
    first; nothing is removed before you agree.

    Attributes:
        who: The person's name, as --likeness stated it; or paths of what is theirs: a recording, a
            model, a bundle, a video, a film, a whole folder.
        project: The folder to look through, with all folders below it.
        yes: Agree to the removal without being asked.
    """

    who: tyro.conf.Positional[tuple[str, ...]]
    project: Path = Path()
    yes: bool = False

    def run(self) -> None:
        """Lists, asks, removes, and tells what remains.

        Raises:
            SettingsError: If nobody is named, nothing belongs to them, a path lies outside of the
                project, nobody is there to agree, a process works at something of it, or something
                cannot be removed.
        """
        from rich.console import Console

        from ico3d.avatar.forgetting.choosing import belonging, outermost, remaining, within
        from ico3d.avatar.forgetting.holdings import find_holdings
        from ico3d.avatar.forgetting.removal import check_idle, links_in, remove, with_tracks
        from ico3d.errors import printable

        console = Console(highlight=False, soft_wrap=True, markup=False)
        project = Path(os.path.abspath(self.project))
        paths, names = self._meant(project)
        holdings = find_holdings(project)
        chosen = belonging(holdings, paths, names)
        theirs = outermost([*with_tracks(paths), *(one.path for one in chosen)])
        if not theirs:
            raise self._nobody(holdings)
        for path, inside in within(theirs, chosen).items():
            console.print(printable(f"{path}{_described(inside)}"))
        self._ask(len(theirs))
        check_idle(theirs)
        targets = links_in(theirs)
        remove(theirs)
        console.print(f"{len(theirs)} removed. What may remain elsewhere, and is not removed:")
        for sentence in (*targets, *remaining(holdings, chosen, theirs)):
            console.print(printable(f"- {sentence}"))

    def _meant(self, project: Path) -> tuple[list[Path], set[str]]:
        """The paths, absolute, and the names, as they are compared, that are named."""
        from ico3d.common.people.stated import alike
        from ico3d.errors import SettingsError

        if not self.who:
            raise SettingsError("ico3d forget needs a person's name, or paths of what is theirs.")
        paths, names = [], set()
        for word in self.who:
            path = Path(os.path.abspath(word))
            if not os.path.lexists(path):
                if os.sep in word:
                    raise SettingsError(f"there is nothing at {word}.")
                names.add(alike(word.strip()))
            elif project not in path.parents:
                raise SettingsError(f"{word} does not lie below {project}: name it by --project.")
            else:
                paths.append(path)
        return paths, names

    def _nobody(self, holdings: "Sequence[Holding]") -> Exception:
        from ico3d.errors import SettingsError

        known = sorted({name for one in holdings if one.names for name in one.likenesses})
        named = f"; stated are: {', '.join(known)}" if known else ""
        return SettingsError(
            f"nothing in {self.project} says that it is the likeness of "
            f"{' or '.join(self.who)}{named}. Name paths of what is theirs instead."
        )

    def _ask(self, count: int) -> None:
        """Raises SettingsError where nobody agrees."""
        from rich.prompt import Confirm

        from ico3d.errors import SettingsError

        if self.yes:
            return
        if not sys.stdin.isatty():
            raise SettingsError("nothing was removed: agree to it with --yes.")
        if not Confirm.ask(f"Remove {count} for good?", default=False):
            raise SettingsError("nothing was removed.")


def _described(inside: "Sequence[Holding]") -> str:
    """What is removed with a path that holds these, for people."""
    names = dict.fromkeys(name for one in inside for name in one.likenesses)
    kinds = dict.fromkeys(one.what for one in inside)
    if not inside:
        return ""
    return f": {', '.join(kinds)}" + (f" of {', '.join(names)}" if names else "")
