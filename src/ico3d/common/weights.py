"""Finds pretrained weights on this machine.

Nothing is downloaded here; only the command `ico3d weights fetch NAME` does that.
"""

import os
from pathlib import Path

from ico3d.common.catalogue.kinds import FilesPackage, Weights
from ico3d.common.catalogue.table import TABLE
from ico3d.errors import MissingModelError, SettingsError


def weights_named(name: str) -> Weights:
    """The entry of `TABLE` with this name.

    Raises:
        SettingsError: If the table has no such entry.
    """
    if name not in TABLE:
        raise SettingsError(f"there are no weights '{name}': choose from {', '.join(TABLE)}.")
    return TABLE[name]


def model_folders() -> list[Path]:
    """Folders that are searched for weights: `$ICO3D_MODELS` if set, then the user's cache.

    Downloads are written to the last one, `~/.cache/ico3d/models`.
    """
    folders = [Path(p) for p in (os.environ.get("ICO3D_MODELS"),) if p]
    return [*folders, Path.home() / ".cache" / "ico3d" / "models"]


def find_model(name: str) -> Path | None:
    """Path of a file or folder of this name in `model_folders()`; None where there is none.

    A path is no name: nothing outside of these folders is found.
    """
    if not name or name == ".." or Path(name).name != name:
        return None
    places = (folder / name for folder in model_folders())
    return next((place for place in places if os.path.exists(place)), None)


def cached(name: str) -> Path | None:
    """Path of installed weights; downloads nothing.

    Args:
        name: A key of `TABLE`.

    Returns:
        The file where the weights are one file, otherwise the folder of the files or of the
        repository; a copy of a repository in `model_folders()` counts if it has the last part of
        the repository's name. None where the weights are not installed.

    Raises:
        SettingsError: If the table has no such weights.
    """
    weights = weights_named(name)
    if weights.repository:
        return _repository_folder(weights)
    if isinstance(weights.package, FilesPackage):
        return _packaged_folder(weights.package)
    for folder in model_folders():
        if all(os.path.isfile(folder / file.name) for file in weights.files):
            return folder / weights.files[0].name if len(weights.files) == 1 else folder
    return None


def model_file(name: str, purpose: str) -> Path:
    """Path of a model file in `model_folders()`.

    Args:
        name: Name of the file.
        purpose: The part of ico3d that needs the file, named in the error.

    Raises:
        MissingModelError: If no folder has the file; the sentence says how to get it.
    """
    found = find_model(name)
    if found is not None:
        return found
    get = how_to_get(name)
    advice = f" {get[0].upper()}{get[1:]}"
    raise MissingModelError.of("model", f"{purpose} cannot begin: ", advice, {"file": name})


def model_of(name: str) -> Path:
    """Path of installed weights, as `cached` returns it.

    Raises:
        MissingModelError: If the weights are not installed; the sentence says how to get them.
    """
    found = cached(name)
    if found is None:
        weights = weights_named(name)
        raise MissingModelError(
            f"the weights '{name}' are not here: fetch them with ico3d weights fetch {name} "
            f"({weights.licence}), or put a copy of {weights.source} into {model_folders()[-1]}."
        )
    return found


def how_to_get(file: str) -> str:
    """The end of an error sentence: how to get a missing model file."""
    place = (
        f"put it into {model_folders()[-1]} or name its folder in the environment variable "
        "ICO3D_MODELS."
    )
    for weights in TABLE.values():
        if any(entry.name == file for entry in weights.files):
            verb = f"ico3d weights fetch {weights.name}"
            return f"fetch it with {verb} ({weights.licence}), or {place}"
    return place


def _packaged_folder(package: FilesPackage) -> Path | None:
    """The folder of files that came out of a package, if none of them is missing."""
    for folder in model_folders():
        if all(os.path.isfile(folder / package.folder / name) for name in package.kept):
            return folder / package.folder
    return None


def _repository_folder(weights: Weights) -> Path | None:
    """A repository's files, in a folder of weights or in the hub's cache."""
    must = weights.wanted[0]
    own = find_model(weights.repository.split("/")[-1])
    if own is not None and os.path.isfile(own / must):
        return own
    try:
        from huggingface_hub import try_to_load_from_cache
    except ImportError:
        return None
    found = try_to_load_from_cache(weights.repository, must)
    return Path(found).parents[must.count("/")] if isinstance(found, str) else None
