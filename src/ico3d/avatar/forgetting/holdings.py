"""What a project folder holds of people: recordings, models, runs, bundles, and whose they are."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ico3d.avatar.forgetting.removal import GONE
from ico3d.avatar.models import KINDS
from ico3d.bundle.archive import open_archive
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import MANIFEST, Manifest
from ico3d.capture.writing.new_folder import UNFINISHED, is_unfinished
from ico3d.common.files import LONGEST, read_object, resolved, walk
from ico3d.common.people.stated import BETWEEN, NOBODY, alike, is_stated
from ico3d.errors import Ico3dError

RUN = "settings.json"
"""File of every training, finished or not, that names what it was made of."""
MADE_OF = ("capture", "head", "continued")
"""Entries of `RUN` that are paths."""
VOICE = "cloned_voice.json"
"""File beside a voice that `ico3d create` has cloned."""
RECORDINGS = {
    UNFINISHED: UNFINISHED,
    "transforms_train.json": "ico3d.json",
    "cameras.json": "cameras.json",
    "capture.json": "capture.json",
    "consent.json": "consent.json",
    VOICE: VOICE,
}
"""Files that mark folders of recordings, and those that say of whom: also of incomplete ones.

Files of data sets lie among others', and are named by their paths.
"""
WORK, ABOUT = ".work", "about.json"
"""Suffix and mark of folders in which `ico3d create` makes avatars, each beside its bundle."""
BUNDLE, ZIP = ".ico3d", b"PK\3\4"
"""How names of bundles end, and how their content begins under whichever name."""
PARTS = ("capture", "head", "body")
"""Entries of a model's summary that say whom it shows."""
MODELS = tuple(kind.file for kind in KINDS if kind.model is not Bundle)


@dataclass(frozen=True)
class Holding:
    """Something that shows a person.

    Attributes:
        path: A folder or a file; absolute, links not followed.
        what: What it is, for people.
        likenesses: Whose likeness it is; empty where that is not stated.
        made_of: What it was made of: recordings and models.
        sources: What a recording was made from, as it states it.
    """

    path: Path
    what: str
    likenesses: tuple[str, ...]
    made_of: tuple[Path, ...] = ()
    sources: tuple[str, ...] = ()

    @property
    def names(self) -> set[str]:
        """The people whom it shows, as names are compared; of synthetic people nobody."""
        return {alike(name) for name in self.likenesses if name != NOBODY}


def find_holdings(project: Path) -> list[Holding]:
    """Finds all that shows people in a folder and below it.

    Of hidden folders it looks only into unfinished recordings.

    Args:
        project: The folder, absolute. Linked folders in it are looked at, but not below.
    """
    return list(_walk(project))


def _walk(project: Path) -> Iterator[Holding]:
    led_to: dict[str, Holding | None] = {}  # by real paths: a thousand links may lead to one place
    for folder, folders, files in walk(project):
        yield from _removed(folder, [*folders, *files])
        folders[:] = sorted(n for n in folders if not n.startswith(".") or is_unfinished(n))
        if folder != project and (found := _folder(folder)) is not None:
            yield found
        for link in (folder / name for name in folders if os.path.islink(folder / name)):
            place = str(resolved(link))
            if place not in led_to:
                led_to[place] = _folder(link)
            if (found := led_to[place]) is not None:
                yield replace(found, path=link)
        for file in (folder / name for name in sorted(files)):
            if (found := _file(file)) is not None:
                yield found


def _removed(folder: Path, names: Sequence[str]) -> Iterator[Holding]:
    """What `ico3d studio` began to remove there, and was ended before all of it was gone."""
    for name in sorted(names):
        if (match := GONE.fullmatch(name)) is not None:
            yield Holding(folder / name, "what is left of a removal", _named(match[1]))


def _folder(folder: Path) -> Holding | None:
    """What a folder is; None where it is none of ours."""
    about = next((file for mark, file in RECORDINGS.items() if os.path.isfile(folder / mark)), None)
    if about is not None:
        return _recording(folder, about)
    if os.path.isfile(folder / MANIFEST):
        return _bundle(folder)
    if os.path.isfile(folder / ABOUT) and (found := _workplace(folder)) is not None:
        return found
    is_run, made_of = _training(folder)
    models = [_shown(folder / name) for name in MODELS]
    is_model = any(names is not None for names in models)
    if not is_model and not is_run:
        hidden = is_unfinished(folder.name)
        return Holding(folder, "an unfinished recording", ()) if hidden else None
    named = _named(*(name for names in models for name in names or ()))
    what = "a model" if is_model else "an unfinished training"
    return Holding(folder, what, named, made_of)


def _training(folder: Path) -> tuple[bool, tuple[Path, ...]]:
    """Whether there was a training in a folder, and what it says that it was made of."""
    run = read_object(folder / RUN)
    stated = [text for name in MADE_OF if isinstance(text := run.get(name), str)]
    return "capture" in run, tuple(Path(text) for text in stated if len(text) < LONGEST)


def _shown(file: Path) -> list[str] | None:
    """Whom a model shows, as its file states it; None where there is no such file.

    Of the file nothing else is kept: it may be large.
    """
    model = read_object(file)
    if not model:
        return None
    summary = model.get("summary")
    parts = [summary.get(key) for key in PARTS] if isinstance(summary, dict) else []
    return [str(part.get("likeness", "")) for part in parts if isinstance(part, dict)]


def _workplace(folder: Path) -> Holding | None:
    """A folder of `ico3d create`, with pictures of whom the avatar is named after."""
    named = folder.suffix == WORK
    if not named and not read_object(folder / ABOUT).keys() >= {"video", "sha256"}:
        return None
    return Holding(folder, "a workplace", _named(folder.stem) if named else ())


def _recording(folder: Path, file: str) -> Holding:
    known = read_object(folder / file)
    about = known.get("provenance", known)
    about = about if isinstance(about, dict) else {}
    sources = about.get("sources", ())
    sources = tuple(map(str, sources)) if isinstance(sources, list) else ()
    likeness = NOBODY if file == "capture.json" else str(about.get("likeness", ""))
    what = "a cloned voice" if file == VOICE else "a recording"
    if file == UNFINISHED or is_unfinished(folder.name):
        what = "an unfinished recording"
    return Holding(folder, what, _named(likeness), (), sources)


def _file(file: Path) -> Holding | None:
    """What a file is; None where it is no bundle, by its name or by its content."""
    if file.suffix.casefold() == BUNDLE:
        return _bundle(file)
    try:
        if not os.path.isfile(file):
            return None
        with file.open("rb", buffering=0) as opened:
            if opened.read(len(ZIP)) != ZIP:
                return None
        Manifest.from_json(open_archive(file).read(MANIFEST))
    except (OSError, Ico3dError, KeyError):
        return None
    return _bundle(file)


def _bundle(path: Path) -> Holding:
    try:
        about = Manifest.from_json(open_archive(path).read(MANIFEST)).provenance
    except (OSError, Ico3dError, KeyError):  # damaged, but here
        return Holding(path, "a bundle", ())
    return Holding(path, "a bundle", (NOBODY,) if about.is_synthetic else _named(about.likeness))


def _named(*likenesses: str) -> tuple[str, ...]:
    """Each person once, of texts that may name several."""
    names = (name.strip() for text in likenesses for name in text.split(BETWEEN))
    return tuple(dict.fromkeys(name for name in names if is_stated(name)))
