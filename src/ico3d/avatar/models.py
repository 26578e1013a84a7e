"""Opens model folders and bundles: one table tells every verb which kind a folder holds."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ico3d.avatar.avatar import ABOUT as AVATAR
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.body.model_folder import ABOUT as BODY
from ico3d.body.model_folder import TrainedBody
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import MANIFEST
from ico3d.bundle.packaged import bundle_path
from ico3d.errors import ModelError
from ico3d.head.model_folder import ABOUT as HEAD
from ico3d.head.model_folder import TrainedHead
from ico3d.scene.model_folder import ABOUT as SCENE
from ico3d.scene.model_folder import TrainedScene

Model = TrainedAvatar | TrainedBody | TrainedHead | TrainedScene | Bundle
"""All kinds of models that can be opened."""
M = TypeVar("M", bound=Model)


@dataclass(frozen=True)
class Kind:
    """One kind of model.

    Attributes:
        name: The kind as error messages call it, such as "a body".
        file: Name of the file that marks a folder of this kind.
        model: Class of the opened model.
        read: Opens a model of this kind, onto the CPU.
        verb: The verb of `ico3d` that makes such models.
    """

    name: str
    file: str
    model: type[Model]
    read: Callable[[Path], Model]
    verb: str

    def __str__(self):
        """Name, file and verb of the kind, for error messages."""
        return f"{self.name} ({self.file}, made by ico3d {self.verb})"


KINDS = (
    Kind("a whole person", AVATAR, TrainedAvatar, TrainedAvatar.load, "assemble"),
    Kind("a body", BODY, TrainedBody, TrainedBody.load, "train body"),
    Kind("a head", HEAD, TrainedHead, TrainedHead.load, "train head"),
    Kind("a static scene", SCENE, TrainedScene, TrainedScene.load, "train static"),
    Kind("a bundle", MANIFEST, Bundle, Bundle.open, "bake"),
)
"""All kinds, in the order in which a folder is tested; a bundle may be a single file, too."""


def open_model(path: Path | str, *models: type[M]) -> M:
    """Opens a model folder or a bundle, onto the CPU.

    Args:
        path: The folder or bundle. Where `models` contains `Bundle`, "demo" names the bundle in
            the package.
        models: Classes of the models that the caller can use.

    Raises:
        ModelError: If the path holds none of these kinds, or a damaged model.
        BundleError: If the path is a damaged bundle.
    """
    path = bundle_path(path) if Bundle in models else Path(path)
    found = _kind_of(path)
    if found is None or found.model not in models:
        raise ModelError(_refusal(path, found, [kind for kind in KINDS if kind.model in models]))
    model = found.read(path)
    assert isinstance(model, models)
    return model


def _kind_of(path: Path) -> Kind | None:
    """The kind of model at a path, None if unknown; any single file is taken for a bundle."""
    return next((kind for kind in KINDS if _is(path, kind)), None)


def _is(path: Path, kind: Kind) -> bool:
    return os.path.isfile(path / kind.file) or (kind.model is Bundle and os.path.isfile(path))


def _refusal(path: Path, found: Kind | None, wanted: list[Kind]) -> str:
    """Error message: what the path holds, and which kinds were expected."""
    *names, last = map(str, wanted)
    expected = f"{', '.join(names)} or {last}" if names else last
    if not os.path.exists(path):
        return f"there is nothing at {path}: expected {expected}."
    if found is None:
        return f"{path} holds no model that is known here: expected {expected}."
    return f"{path} holds {found.name}: expected {expected}."
