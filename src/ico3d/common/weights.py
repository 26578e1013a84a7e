"""Where weights lie that ico3d can use and does not ship.

Nothing is downloaded unless the user says `ico3d weights fetch NAME`.
"""

import os
from pathlib import Path

from ico3d.common.catalogue.kinds import Weights
from ico3d.common.catalogue.table import TABLE
from ico3d.errors import MissingModelError, SettingsError


def weights_named(name: str) -> Weights:
    """An entry of the table.

    Raises:
        SettingsError: If there is none of this name.
    """
    if name not in TABLE:
        raise SettingsError(f"there are no weights '{name}': choose from {', '.join(TABLE)}.")
    return TABLE[name]


def model_folders() -> list[Path]:
    """Where weights are looked for: `$ICO3D_MODELS`, then the user's cache, where fetched ones go.

    The last one, `~/.cache/ico3d/models`, is the one to write to.
    """
    folders = [Path(p) for p in (os.environ.get("ICO3D_MODELS"),) if p]
    return [*folders, Path.home() / ".cache" / "ico3d" / "models"]


def find_model(name: str) -> Path | None:
    """A file or folder by its name in the folders of weights; None where it lies in neither."""
    places = (folder / name for folder in model_folders())
    return next((place for place in places if place.exists()), None)


def cached(name: str) -> Path | None:
    """Where weights of the table lie on this machine; nothing is downloaded.

    Args:
        name: A key of `TABLE`.

    Returns:
        The file; for several files or a repository their folder (a copy named like the
        repository's last part in a folder of weights counts); None where they are not there.

    Raises:
        SettingsError: If the table has no such weights.
    """
    weights = weights_named(name)
    if weights.repository:
        return _repository_folder(weights)
    for folder in model_folders():
        if all((folder / file.name).is_file() for file in weights.files):
            return folder / weights.files[0].name if len(weights.files) == 1 else folder
    return None


def model_file(name: str, purpose: str) -> Path:
    """Finds a model file in the folders of weights.

    Args:
        name: The file.
        purpose: What needs it, for the error.

    Raises:
        MissingModelError: If it lies in none of them; the sentence says how to get it.
    """
    found = find_model(name)
    if found is not None:
        return found
    raise MissingModelError(f"{purpose} needs the model file '{name}': {how_to_get(name)}")


def model_of(name: str) -> Path:
    """Where weights of the table lie.

    Raises:
        MissingModelError: If they are not on this machine; the sentence says how to get them.
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
    """The end of a sentence that says where a missing file comes from."""
    place = (
        f"put it into {model_folders()[-1]} or name its folder in the environment variable "
        "ICO3D_MODELS."
    )
    for weights in TABLE.values():
        if any(entry.name == file for entry in weights.files):
            verb = f"ico3d weights fetch {weights.name}"
            return f"fetch it with {verb} ({weights.licence}), or {place}"
    return place


def _repository_folder(weights: Weights) -> Path | None:
    """A repository's files, in a folder of weights or in the hub's cache."""
    must = weights.wanted[0]
    own = find_model(weights.repository.split("/")[-1])
    if own is not None and (own / must).is_file():
        return own
    try:
        from huggingface_hub import try_to_load_from_cache
    except ImportError:
        return None
    found = try_to_load_from_cache(weights.repository, must)
    return Path(found).parents[must.count("/")] if isinstance(found, str) else None
