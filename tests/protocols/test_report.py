"""Reports: tables and pictures in Markdown, figures in JSON."""

import json

import numpy as np
import pytest
import torch

from ico3d.protocols.facts import facts_of
from ico3d.protocols.report import Column, Picture, Report, Section, Table
from ico3d.protocols.rows import means, spread_of

COLUMNS = (
    Column("psnr", "PSNR", 2, "more"),
    Column("lpips", "LPIPS", 3, "less"),
    Column("count", "Gaussians", 0),
    Column("nothing", "Sync-C"),
)
ROWS = (
    {"name": "ours", "psnr": 30.126, "lpips": 0.0504, "count": 12_000},
    {"name": "theirs", "psnr": 29.0, "lpips": None, "count": 9_500, "nothing": None},
    {"name": "old", "psnr": 28.5, "lpips": 0.0612, "count": 100},
)


def test_the_best_values_are_bold_and_what_is_missing_is_said():
    table = Table(COLUMNS, ROWS, "method")
    assert table.markdown().splitlines() == [
        "| method | PSNR ↑ | LPIPS ↓ | Gaussians |",
        "|---|---|---|---|",
        "| ours | **30.13** | **0.050** | 12,000 |",
        "| theirs | 29.00 | – | 9,500 |",
        "| old | 28.50 | 0.061 | 100 |",
    ]
    assert table.absent() == ["Sync-C"]
    section = Section("Quality", "How.", table, [Picture("a.png", "One picture")])
    text = section.markdown(2, "part/")
    assert text.startswith("## Quality\n\nHow.\n\n| method")
    assert "Not measured here: Sync-C." in text
    assert text.endswith("![One picture](part/a.png)\n\n*One picture*")


def test_a_single_row_has_no_best():
    assert "**" not in Table(COLUMNS, ROWS[:1]).markdown()


def test_files_hold_all(tmp_path):
    section = Section("Quality", table=Table(COLUMNS, ROWS))
    report = Report("How good?", {"seeds": "0, 1", "settings": {"steps": 3}}, [section], {"a": 1})
    report.write(tmp_path)
    told = json.loads((tmp_path / "report.json").read_text())
    assert told["facts"]["settings"] == {"steps": 3} and told["figures"] == {"a": 1}
    text = (tmp_path / "report.md").read_text()
    assert text.startswith("# How good?\n\n- seeds: 0, 1\n\n## Quality\n\n|")
    assert "steps" not in text


def test_facts_tell_what_must_be_known():
    facts = facts_of(torch.device("cpu"), test_cameras="c1, c4")
    assert facts["device"] == "cpu" and facts["test cameras"] == "c1, c4"
    assert str(facts["ico3d"]).startswith("0.") and facts["torch"] == torch.__version__
    assert "cores" in str(facts["machine"]) and str(facts["command"]).startswith("ico3d")


def test_means_of_what_all_seeds_have():
    rows = [{"name": "a", "psnr": 1.0, "lag": None}, {"name": "b", "psnr": 4.0, "lag": 2.0}]
    assert means(rows) == {"psnr": 2.5}
    assert spread_of(rows, "psnr") == 3.0 and spread_of(rows, "lag") is None
    assert spread_of([{"psnr": np.float64(2)}], "psnr") is None


@pytest.mark.parametrize("better", ["more", "less"])
def test_equal_values_are_all_best(better):
    rows = [{"name": name, "x": 2.0} for name in "ab"]
    assert Table([Column("x", "X", 1, better)], rows).markdown().count("**2.0**") == 2
