"""The protocol of the viewer: frame rates, part by part."""

import numpy as np
import pytest
import torch

from ico3d.avatar.camera_path import orbit, ring_around
from ico3d.protocols import viewer
from ico3d.protocols.viewer import Staged, frame_rate, measure_viewer, viewer_rows
from ico3d.splat.gaussians import Gaussians

CPU = torch.device("cpu")


def ball(count: int) -> Gaussians:
    """Gaussians within half a metre."""
    places = torch.from_numpy(np.random.default_rng(0).normal(0, 0.2, (count, 3))).float()
    turns = torch.tensor([1.0, 0, 0, 0]).repeat(count, 1)
    return Gaussians(
        places, turns, torch.full((count, 3), 0.02), torch.ones(count) * 0.5, torch.ones(count, 3)
    )


@pytest.fixture
def small(monkeypatch):
    """Small and few pictures."""
    monkeypatch.setattr(viewer, "SIZES", ((40, 40), (64, 36)))
    monkeypatch.setattr(viewer, "PICTURES", 4)


def test_rows_are_those_of_the_papers_table(small):
    asked = []

    def body(seconds: float) -> Gaussians:
        asked.append(seconds)
        return ball(30)

    parts = {"background": lambda _: ball(100), "body": body, "head": lambda _: ball(20)}
    rows = viewer_rows(Staged(parts, 2.0, CPU))
    assert [(row["name"], row["gaussians"]) for row in rows] == [
        ("background", 100),
        ("background + body", 130),
        ("background + head", 120),
        ("background + body + head", 150),
    ]
    for row in rows:
        assert row["fps_40x40"] == pytest.approx(1000 / row["ms_40x40"])
        assert row["p95_64x36"] >= row["ms_64x36"] > 0 and "peak_mib" not in row
    assert max(asked) < 2.0 and len(set(asked)) > 4, "every picture is of another moment"


def test_without_a_background_rows_are_not_repeated(small):
    rows = viewer_rows(Staged({"body": lambda _: ball(30)}, 1.0, CPU))
    assert [row["name"] for row in rows] == ["body"]


def test_the_first_pictures_are_not_timed():
    points = np.random.default_rng(0).normal(0, 0.2, (50, 3))
    cameras = orbit(ring_around(points), points, viewer.WARM + 2, 16, 16)
    calls = []

    def slow_at_first(seconds: float) -> Gaussians:
        calls.append(seconds)
        if len(calls) <= viewer.WARM:
            ball(400_000)
        return ball(10)

    warm = frame_rate([slow_at_first], cameras, 1.0, CPU)
    assert len(calls) == viewer.WARM + 2 and warm["gaussians"] == 10
    cold = frame_rate([lambda _: ball(400_000)[:10]], cameras, 1.0, CPU)
    assert warm["p95"] < cold["p95"]


@pytest.mark.slow
def test_the_packaged_avatar(small, tmp_path):
    report = measure_viewer("demo", tmp_path, None, CPU)
    assert report.figures["rows"][-1]["name"].endswith("body + head")
    text = (tmp_path / "report.md").read_text()
    assert "FPS" in text and "memory of the GPU" in text.split("Not measured here")[1]
