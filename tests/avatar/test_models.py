"""Model folders and bundles are told apart by the files in them."""

from pathlib import Path

import pytest

from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.models import KINDS, open_model
from ico3d.body.model_folder import TrainedBody
from ico3d.bundle.format import Bundle
from ico3d.errors import BundleError, ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.scene.model_folder import TrainedScene
from support.avatars.whole_person import write_whole_person

EVERY = tuple(kind.model for kind in KINDS)


@pytest.fixture(scope="module")
def person(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("models") / "person"
    write_whole_person(folder)
    return folder


def test_a_person_and_its_parts_are_told_apart(person):
    assert type(open_model(person, *EVERY)) is TrainedAvatar
    assert type(open_model(person / "body", *EVERY)) is TrainedBody
    assert type(open_model(person / "head", *EVERY)) is TrainedHead
    assert type(open_model("demo", TrainedAvatar, Bundle)) is Bundle


def test_what_a_folder_holds_instead_is_named(person):
    with pytest.raises(ModelError) as refusal:
        open_model(person / "head", TrainedBody, TrainedAvatar)
    assert str(refusal.value) == (
        f"{person / 'head'} holds a head: expected a whole person (avatar.json, made by ico3d "
        "assemble) or a body (body.json, made by ico3d train body)."
    )


def test_all_that_is_known_is_named_where_there_is_nothing(tmp_path):
    with pytest.raises(ModelError, match="no model that is known here") as refusal:
        open_model(tmp_path, *EVERY)
    assert all(str(kind) in str(refusal.value) for kind in KINDS)
    with pytest.raises(ModelError, match=r"there is nothing at .*gone: expected a head \(head"):
        open_model(tmp_path / "gone", TrainedHead)


@pytest.mark.parametrize("kind", KINDS[:-1], ids=lambda kind: kind.name)
def test_what_is_damaged_is_of_its_kind_still(tmp_path, kind):
    (tmp_path / kind.file).write_text("[]")
    with pytest.raises(ModelError, match=f"{tmp_path} holds no "):
        open_model(tmp_path, *EVERY)


def test_a_file_is_taken_for_a_bundle_where_bundles_are_wanted(tmp_path):
    file = tmp_path / "person.ico3d"
    file.write_bytes(b"not a zip archive, though it is long enough to look like one")
    with pytest.raises(BundleError):
        open_model(file, TrainedScene, Bundle)
    with pytest.raises(ModelError, match="holds a bundle: expected a static scene"):
        open_model(file, TrainedScene)
