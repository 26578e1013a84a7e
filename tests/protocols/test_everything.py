"""All protocols in one run."""

from pathlib import Path

import pytest

from ico3d.errors import CaptureError
from ico3d.protocols import everything
from ico3d.protocols.everything import SMALL, AllTerms, Size, measure_all, protocols
from ico3d.protocols.report import Report, Section


def terms(out: Path, size: Size = SMALL, **given) -> AllTerms:
    """Terms with the packaged avatar."""
    values = {"portraits": (), "bodies": (), "avatar": Path("demo"), "subject": "nobody"} | given
    return AllTerms(out, size=size, preset="cpu", device="cpu", **values)


def test_given_recordings_are_taken_and_numbered(tmp_path):
    found = protocols(terms(tmp_path, portraits=(Path("a"), Path("b")), bodies=(Path("c"),)))
    names = [name for name, _ in found]
    assert names == [
        "viewer",
        "portrait-1",
        "portrait-2",
        "body",
        "head-ablations",
        "body-ablations",
    ]


def test_small_is_small_in_all_things(tmp_path):
    head, body = terms(tmp_path).head(), terms(tmp_path).body()
    assert head.steps == 500 and head.density.until < 500
    assert body.steps_of(10) == 400 and body.warmup_steps < 400
    assert head.density.max_gaussians == body.density.max_gaussians == 3_000
    whole = terms(tmp_path, Size())
    assert whole.head().steps > 1_000 and whole.seeds == (0, 1, 2)


def test_one_that_fails_does_not_stop_the_others(tmp_path, monkeypatch, capsys):
    def fails(out: Path) -> Report:
        raise CaptureError("there is no sound.")

    def works(out: Path) -> Report:
        report = Report("How fast?", {}, [Section("Speed", "Fast.")])
        report.write(out)
        return report

    monkeypatch.setattr(everything, "protocols", lambda _: [("portrait", fails), ("viewer", works)])
    measure_all(terms(tmp_path))
    text = (tmp_path / "report.md").read_text()
    assert "Failed: there is no sound." in text and "## How fast?" in text
    assert "[Alone](viewer/report.md)" in text and "there is no sound" in capsys.readouterr().out


def test_recordings_are_made_once_in_the_data_sets_layouts(tmp_path, monkeypatch):
    made = []

    def record(recording, folder, workers):
        made.append(recording)
        folder.mkdir(parents=True)
        (folder / "capture.json").touch()

    def written(capture, folder, *_):
        folder.mkdir(parents=True)
        return folder

    monkeypatch.setattr(everything, "record", record)
    monkeypatch.setattr(everything, "open_capture", lambda path: path)
    monkeypatch.setattr(everything, "write_dna", written)
    monkeypatch.setattr(everything, "write_portrait", written)
    for _ in range(2):
        protocols(terms(tmp_path))
    head, body = made
    assert (head.rig, head.cameras, head.frames, head.size) == ("head", 1, 220, 192)
    assert (body.rig, body.cameras, body.views_per_frame) == ("body", 10, 10)
    assert sorted(p.name for p in (tmp_path / "recordings").iterdir()) == [
        "body",
        "portrait",
        "studio-body",
        "studio-portrait",
    ]


@pytest.mark.parametrize("name", ["body", "portrait"])
def test_an_interrupted_writing_is_begun_again(tmp_path, name):
    folder = tmp_path / name

    def breaks(to: Path) -> Path:
        to.mkdir()
        (to / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        everything._whole(folder, breaks)
    assert not folder.exists()

    def whole(to: Path) -> Path:
        to.mkdir()
        return to

    everything._whole(folder, whole)
    assert folder.is_dir() and not list(folder.iterdir())
