"""Which device is computed on, for every kind of broken installation."""

import importlib
import re
import sys
import tomllib
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from ico3d.cli import VERBS
from ico3d.errors import SettingsError
from ico3d.splat import convention, device
from ico3d.splat.device import computing_device, cuda_fault
from support.pretended_cuda import CUDA, install_gsplat, pretended_cuda, rasterization


@pytest.fixture(autouse=True)
def look_again():
    """What was found out, and said, on another test's machine."""
    for known in (cuda_fault, device._say_once):
        known.cache_clear()
    yield
    for known in (cuda_fault, device._say_once):
        known.cache_clear()


def _none(*_, **__):
    """As gsplat's functions end where nothing was compiled."""
    return None.CameraModelType  # type: ignore[attr-defined]


def _raising(*_, **__):
    raise RuntimeError("CUDA error: no kernel image is available\nfor execution on the device")


def _bounded(*arguments, **options):
    """As gsplat 1.6 bounds alpha."""
    rgb, alpha, meta = rasterization(*arguments, **options)
    return rgb, alpha.clamp_max(0.99), meta


def _without_gradients(*arguments, **options):
    rgb, alpha, meta = rasterization(*arguments, **options)
    return rgb, alpha.detach() + 0 * alpha, meta


BROKEN = {
    "missing": (None, "needs the package 'gsplat': install it with pip install 'ico3d\\[cuda"),
    "not compiled": ({"rasterization": _none}, "without its compiled part: it needs .* nvcc"),
    "too new": ({"__version__": "1.6.0"}, "gsplat 1.6.0 is installed, which draws otherwise"),
    "too new, development": ({"__version__": "1.6.0.dev3+cu128"}, "gsplat 1.6.0.dev3"),
    "too old": ({"__version__": "1.4.0"}, "takes 1.5.3 or newer and older than 1.6"),
    "raising": ({"rasterization": _raising}, r"fails to render \(RuntimeError: CUDA error: no"),
    "other pictures": ({"rasterization": _bounded}, r"alpha 0.9900 with slope .* expected 0.9990"),
    "no gradients": ({"rasterization": _without_gradients}, "with slope 0.0000, expected"),
}


def _break(monkeypatch, changes: dict | None) -> None:
    """Puts a broken gsplat in the place of the one that works."""
    if changes is None:
        monkeypatch.setitem(sys.modules, "gsplat", None)
        return
    install_gsplat(monkeypatch, **changes)
    if changes.get("rasterization") is _none:
        monkeypatch.setitem(sys.modules, "gsplat.cuda._backend", SimpleNamespace(_C=None))


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_installation_is_one_sentence_and_the_cpu(monkeypatch, capfd, name):
    changes, sentence = BROKEN[name]
    with pretended_cuda(monkeypatch):
        _break(monkeypatch, changes)
        assert [computing_device("auto").type for _ in range(3)] == ["cpu"] * 3
        said = capfd.readouterr().err
        assert re.search(sentence, said) and said.count("\n") == 1  # once
        assert said.startswith("computing on the CPU, not on the CUDA device: ")
        with pytest.raises(SettingsError, match=f"--device cuda does not work here: .*{sentence}"):
            computing_device("cuda")
        assert computing_device("cpu").type == "cpu"


@pytest.mark.parametrize("version", ["1.5.3", "1.5.3+pt29cu128", "1.5.9"])
def test_cuda_that_works_is_taken(monkeypatch, capfd, version):
    with pretended_cuda(monkeypatch, __version__=version):
        assert computing_device("auto") == computing_device("cuda") == torch.device("cuda")
        assert computing_device("cpu") == torch.device("cpu")
        assert device.device_name(CUDA) == "cuda (Pretended)"
    assert capfd.readouterr().err == ""


def test_a_machine_without_cuda_is_not_worth_a_word(monkeypatch, capfd):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert computing_device("auto") == torch.device("cpu")
    assert capfd.readouterr().err == ""
    with pytest.raises(SettingsError, match="does not work here: torch finds no CUDA device"):
        computing_device("cuda")


def test_the_extra_brings_the_versions_that_are_taken():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    oldest, newest = (".".join(map(str, version)) for version in convention.GSPLAT)
    wanted = project["project"]["optional-dependencies"]["cuda"]
    assert wanted == [f"gsplat>={oldest},<{newest}"]


def test_every_verb_that_takes_a_device_is_tested_on_cuda():
    """By its words, by the name of its class, or by the function to which it hands all."""
    handed = {
        "assemble": "assemble(",
        "capture portrait": "track_portrait(",
        "create": "train_head(",
        "measure ablations": "measure_ablations(",
    }
    tests = Path(__file__).parents[1]
    files = [path.read_text("utf-8") for path in tests.rglob("test_*.py") if path != Path(__file__)]
    written = "\n".join(text for text in files if "(cuda" in text)
    missing = []
    for verb, entry in VERBS.items():
        kind = getattr(importlib.import_module(entry.module), entry.name)
        if verb == "measure all" or "device" not in {field.name for field in fields(kind)}:
            continue  # the first runs the others
        words = ", ".join(f'"{word}"' for word in verb.split())
        if not any(name in written for name in (words, f"{entry.name}(", handed.get(verb, words))):
            missing.append(verb)
    assert missing == []
