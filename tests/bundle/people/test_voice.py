"""The cloned voice of a bundle: its file, whose it is, and what a reader refuses."""

import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import save

from ico3d.bundle.format import Bundle, give_voice, write_bundle
from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice
from ico3d.bundle.people.voice import SIZE, VOICE, voice_from_bytes, voice_to_bytes
from ico3d.cli import main
from ico3d.errors import BundleError

TONE = np.random.default_rng(0).normal(size=SIZE).astype(np.float32)
ADA = ClonedVoice(OPENVOICE, "ada.mp4", "agreed on 2026-11-26, ticked and spoken")


@pytest.fixture
def voiced(bundle_path, tmp_path):
    give_voice(bundle_path, ADA, TONE, tmp_path / "voiced.ico3d")
    return tmp_path / "voiced.ico3d"


def test_a_voice_is_carried_and_everything_else_stays(bundle_path, voiced):
    plain, bundle = Bundle.open(bundle_path), Bundle.open(voiced)
    assert plain.voice is None and bundle.voice is not None
    np.testing.assert_array_equal(bundle.voice, TONE)
    assert bundle.manifest.provenance == replace(plain.manifest.provenance, voice=ADA)
    assert set(bundle.manifest.files) == {*plain.manifest.files, VOICE}
    assert bundle.manifest.files[VOICE].size < 1200
    give_voice(voiced, replace(ADA, recording="new.mp4"), -TONE, voiced)
    again = Bundle.open(voiced)
    assert again.voice is not None and again.voice[0] == -TONE[0]
    assert again.manifest.provenance.voice == replace(ADA, recording="new.mp4")


def test_the_manifest_states_it_and_that_of_others_does_not(bundle_path, voiced):
    def stated(path):
        with zipfile.ZipFile(path) as archive:
            return json.loads(archive.read("manifest.json"))["provenance"]

    assert "voice" not in stated(bundle_path)  # programs from before read it
    assert stated(voiced)["voice"] == {
        "engine": "openvoice-v2",
        "recording": "ada.mp4",
        "consent": "agreed on 2026-11-26, ticked and spoken",
    }


def test_bundle_info_says_it(bundle_path, voiced, capsys):
    assert main(["bundle", "info", str(voiced)]) == 0
    said = (
        "voice              cloned from ada.mp4; consent: agreed on 2026-11-26, ticked and spoken"
    )
    assert said in capsys.readouterr().out
    assert main(["bundle", "info", str(bundle_path)]) == 0
    assert "cloned" not in capsys.readouterr().out


@pytest.mark.parametrize("consent", ["", " ", "not stated"])
def test_a_voice_without_consent_is_neither_written_nor_read(
    bundle_path, voiced, tmp_path, consent
):
    out = tmp_path / "out.ico3d"
    with pytest.raises(BundleError, match=r"voice\.consent must say that the voice's owner agreed"):
        give_voice(bundle_path, replace(ADA, consent=consent), TONE, out)
    assert not out.exists()
    changed(voiced, tmp_path / "folder", consent=consent)
    with pytest.raises(BundleError, match=r"voice\.consent must say"):
        Bundle.open(tmp_path / "folder")


def test_a_voice_of_another_engine_is_refused(voiced, tmp_path):
    changed(voiced, tmp_path / "folder", engine="other")
    with pytest.raises(BundleError, match=r"voice\.engine must be openvoice-v2"):
        Bundle.open(tmp_path / "folder")


def changed(path, folder, **values):
    """A bundle as a folder, with other entries of its voice."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["provenance"]["voice"] |= values
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(voiced, value):
    tone = TONE.copy()
    tone[7] = value
    with pytest.raises(BundleError, match=r"voice\.safetensors: 'tone_colour' holds a value that"):
        voice_to_bytes(tone)
    bundle = Bundle.open(voiced)
    files = {name: bundle.read(name) for name in bundle.manifest.files}
    write_bundle(voiced, bundle.manifest, files | {VOICE: save({"tone_colour": tone})})
    with pytest.raises(BundleError, match=r"voice\.safetensors: 'tone_colour' holds a value that"):
        Bundle.open(voiced)


@pytest.mark.parametrize(
    "tensors",
    [
        {},
        {"tone_colour": TONE[:-1]},
        {"tone_colour": TONE.astype(np.float64)},
        {"tone_colour": TONE.reshape(1, SIZE, 1)},
        {"tone_colour": TONE, "more": TONE},
    ],
)
def test_other_tensors_are_refused(tensors):
    with pytest.raises(BundleError, match=r"^voice\.safetensors: "):
        voice_from_bytes(save(tensors))


def test_file_and_statement_come_together(bundle_path, voiced, tmp_path):
    plain, bundle = Bundle.open(bundle_path), Bundle.open(voiced)
    files = {name: bundle.read(name) for name in bundle.manifest.files}
    with pytest.raises(BundleError, match=r"voice\.safetensors: does not belong into this bundle"):
        write_bundle(tmp_path / "a.ico3d", plain.manifest, files)
    files.pop(VOICE)
    with pytest.raises(BundleError, match=r"voice\.safetensors: is missing"):
        write_bundle(tmp_path / "a.ico3d", bundle.manifest, files)
