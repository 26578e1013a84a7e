"""The commands of docs/guides, as they stand there, on recordings of a few tiny pictures."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from guides import guide, recordings
from guides.small import SMALL
from ico3d.avatar.baking import head_bundle
from ico3d.avatar.baking.shader_head import BakeSettings
from ico3d.bundle.format import Bundle
from ico3d.capture.formats import open_capture
from support.needs import needs
from support.shared import MODELS

pytestmark = [pytest.mark.slow, needs("anny")]
MODEL = "face_landmarker.task"


@pytest.fixture(scope="module")
def face(tmp_path_factory):
    return recordings.person(tmp_path_factory.mktemp("studio") / "face")


@pytest.fixture(scope="module")
def body(face):
    return recordings.in_warm_light(face, face.with_name("body"))


@pytest.fixture(autouse=True)
def quick_bakes(monkeypatch):
    """What is baked has hardly been trained: its small network need not be exact."""
    monkeypatch.setattr(
        head_bundle, "BakeSettings", partial(BakeSettings, 32, augmented=20, steps=40)
    )


@pytest.fixture
def tracker(monkeypatch):
    """Whether faces can be tracked here: MediaPipe's model is not part of ico3d."""
    monkeypatch.setenv("ICO3D_MODELS", str(MODELS))
    return (MODELS / MODEL).is_file()


def _tracked(tracker, **truth):
    """Commands that cannot run here, and what to do instead."""

    def put(words):
        folder = Path(words[3])
        recordings.write_known_track(open_capture(truth[folder.name]), folder)

    return {} if tracker else {"capture track": put}


def _is_whole(bundle):
    manifest = Bundle.open(Path(bundle)).manifest
    return manifest.head is not None and manifest.body is not None


def _shows_something(picture):
    with Image.open(picture) as opened:
        return np.asarray(opened.convert("L")).std() > 5


def test_many_cameras(face, body, tracker, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings.many_cameras(face, body, tmp_path)
    guide.follow("many-cameras.md", SMALL, _tracked(tracker, face=face, body=body))
    assert _is_whole("anna.ico3d")
    provenance = Bundle.open(Path("anna.ico3d")).manifest.provenance
    assert (provenance.likeness, provenance.made_by) == ("Anna", "Our studio")
    assert all(_shows_something(p) for p in ("strip.png", "gestures.jpg", *Path("check").iterdir()))
    assert Path("film.mp4").stat().st_size > 1000


def test_dna_renderme(face, body, tracker, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings.data_sets(face, body, tmp_path)
    guide.follow("dna-renderme.md", SMALL, _tracked(tracker, face=face, body=body))
    assert _is_whole("person.ico3d")
    assert "RenderMe-360" in str(Bundle.open(Path("person.ico3d")).manifest.provenance)


def test_phone(face, tracker, tmp_path, monkeypatch):
    if not tracker:
        pytest.skip(f"{MODEL} is not here: a portrait cannot be tracked (set ICO3D_MODELS)")
    monkeypatch.chdir(tmp_path)
    recordings.phone(face, tmp_path)
    guide.follow("phone.md", SMALL)
    manifest = Bundle.open(Path("me.ico3d")).manifest
    assert manifest.head is not None and manifest.provenance.consent.startswith("I agree")
