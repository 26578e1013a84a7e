"""Who did not agree is shown only when the server is told so."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from ico3d.bundle.format import write_bundle
from ico3d.chat.serving import server
from ico3d.cli import main
from support.bundles.random_body import body_files, body_manifest, random_windows


@pytest.fixture
def silent(tmp_path):
    """A bundle that states no consent."""
    windows = random_windows()
    manifest = body_manifest(windows)
    provenance = replace(manifest.provenance, consent="not stated")
    path = tmp_path / "x.ico3d"
    write_bundle(path, replace(manifest, provenance=provenance), body_files(windows))
    return path


@pytest.fixture
def runs(monkeypatch):
    """Servers that began to serve."""
    begun = []
    running = SimpleNamespace(run=lambda sockets: begun.extend(sockets))
    monkeypatch.setattr(server, "make_server", lambda *_: running)
    yield begun
    for listener in begun:
        listener.close()


def test_a_bundle_without_consent_is_refused(silent, runs, capsys):
    assert main(["serve", str(silent), "--port", "0"]) == 1
    refused = f"ico3d: {silent} does not say that the person it shows agreed to it: bake it again"
    assert capsys.readouterr().err.startswith(refused) and not runs


def test_it_is_served_when_told_so(silent, runs):
    assert main(["serve", str(silent), "--port", "0", "--without-consent"]) == 0
    assert len(runs) == 1
