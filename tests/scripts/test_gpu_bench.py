"""The bench for machines with a GPU: all of it at the least size, and wheels that lie beside it."""

import importlib
import json
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from ico3d.errors import CaptureError
from ico3d.training import dry_run
from support.pretended_cuda import drawn

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]


@pytest.fixture
def part(monkeypatch):
    """Gives modules of the bench by their names, as its scripts import them."""
    monkeypatch.syspath_prepend(ROOT / "bench")
    return lambda name: importlib.import_module(f"full_size.{name}")


@pytest.fixture
def least(part, tmp_path, monkeypatch):
    """The least sizes; no weights are installed."""
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path / "none"))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(dry_run, "TIMED", 1)
    return replace(part("parts").TINY, steps=3)


def test_the_report_of_a_gpu(cuda, part, least, tmp_path, monkeypatch):
    """Parts that fail are rows with the error, and the others are measured."""
    parts = part("parts")

    def lost(*_) -> None:
        raise RuntimeError("CUDA error: an illegal | access\nand more")

    monkeypatch.setattr(parts.speed, "body_row", lost)
    names = ("parity", "drawing", "steps", "frames")
    with drawn(monkeypatch) as pictures:
        report, failed = part("report").measure(tmp_path / "out", names, least, "cuda")
    assert failed and len(pictures) > 40
    rows = json.loads((tmp_path / "out" / "report.json").read_text())["figures"]
    assert {row["kept"] for row in rows["parity"]} == {"yes"} and len(rows["parity"]) == 9
    assert rows["drawing"][0]["picture"] > 0 and rows["drawing"][0]["peak_mib"] > 0
    head, body = rows["steps"]
    assert head["gaussians"] == 300 and head["peak_mib"] > 0
    assert head["minutes"] == pytest.approx(head["ms"] * 50_000 / 60_000)
    assert body["fault"] == "RuntimeError: CUDA error: an illegal / access"
    assert [row["gaussians"] for row in rows["frames"]] == [90, 170, 160, 240]
    told = (tmp_path / "out" / "report.md").read_text()
    assert told == report.markdown() + "\n"
    assert "| body, 300 Gaussians | – |" in told and "| background + body + head | 240 |" in told
    with pytest.raises(CaptureError, match="out is not empty: name a new folder"):
        part("report").measure(tmp_path / "out", names, least, "cpu")


def test_a_training_is_killed_and_goes_on(part, least, tmp_path):
    """A scene's, which takes least; every tensor is the same."""
    parts = part("parts")
    measured = parts.Parts(tmp_path, replace(least, steps=9), parts.CPU, None)
    (row,) = measured.training(("static",)).rows
    assert row["alike"] == row["tensors"] > 4 and row["greatest"] == 0, row


def test_parity_is_lost_by_a_few_wrong_pixels(part, least, monkeypatch):
    """But not by one."""
    parity = part("parity")
    draw, wrong = parity._drawn, [1]

    def drawn_wrongly(device, count, size):
        values = draw(device, count, size)
        for value in values.values():
            value.view(-1)[: wrong[0]] += 1 if device.index else 0
        return values

    monkeypatch.setattr(parity, "_drawn", drawn_wrongly)
    other = parity.torch.device("cpu", 1)
    count, size = 500, 40
    kept = {row["name"]: row["kept"] for row in parity.parity_rows(other, count, size)}
    assert kept["depth"] == kept["gradient of means"] == "yes"
    wrong[0] = 30
    kept = {row["name"]: row["kept"] for row in parity.parity_rows(other, count, size)}
    assert kept["depth"] == kept["gradient of means"] == "no"


def test_wheels_are_installed_for_one_run(part, tmp_path):
    """Without an index; torch stays the machine's own."""
    wheels = part("wheels")
    for name in ("brought", "torch"):
        about = f"{name}-1.0.dist-info"
        with zipfile.ZipFile(tmp_path / f"{name}-1.0-py3-none-any.whl", "w") as wheel:
            wheel.writestr(f"{name}.py", "WORD = 'brought along'")
            wheel.writestr(
                f"{about}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n"
            )
            wheel.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\n")
            wheel.writestr(f"{about}/RECORD", "")
    script = tmp_path / "script.py"
    script.write_text("import brought, ico3d, sys\nopen(sys.argv[1], 'w').write(brought.WORD)")
    words = [str(script), str(tmp_path / "said"), "--wheels", str(tmp_path)]
    assert wheels.run_with_wheels(words[:2]) is None and not (tmp_path / "said").exists()
    assert wheels.run_with_wheels(words) == 0
    assert (tmp_path / "said").read_text() == "brought along"
    assert subprocess.run([sys.executable, "-c", "import brought"], stderr=-3).returncode == 1
