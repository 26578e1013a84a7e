"""Tables of a soak: what rises is found, whoever is there meanwhile."""

import csv
from dataclasses import astuple, replace

import numpy as np
import pytest

from ico3d.errors import SettingsError
from ico3d.measure.talking.rising import COLUMNS, Row, draw, read_rows, slope, verdict, warm


def run(hourly=0.0, left=0.0):
    """An hour in which 0 to 4 visitors need 50 tasks each, and tasks rise besides."""
    sessions = np.random.default_rng(0).integers(1, 5, 360)
    rows = [
        Row(10.0 * n, n, 2e8, 20, 2 + 50 * people + hourly * n / 360, people, people, n)
        for n, people in enumerate(sessions)
    ]
    empty = replace(rows[0], tasks=2, descriptors=17, sessions=0, connections=0)
    return [empty, *rows[1:], replace(empty, seconds=3610.0, tasks=2 + left)]


def test_a_slope_is_what_visitors_do_not_account_for():
    assert slope(warm(run(hourly=30.0)), "tasks") == pytest.approx(30, abs=1e-6)
    assert slope(warm(run()), "tasks") == pytest.approx(0, abs=1e-6)
    assert all(row.seconds >= 900 and row.sessions for row in warm(run()))


@pytest.mark.parametrize(("made", "broken"), [(run(), 0), (run(hourly=30.0), 1), (run(left=1), 1)])
def test_a_run_is_broken_by_what_rises_and_by_what_is_left(made, broken):
    claims = verdict(made)
    assert len(claims) == 6 and list(claims.values()).count(False) == broken


def test_a_table_cut_amid_a_row_is_read_and_drawn(tmp_path):
    path = tmp_path / "soak.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *map(astuple, run()[:30])])
        file.write("12.0,3,1")
    rows = read_rows(path)
    assert rows == run()[:30]
    draw(rows, tmp_path / "soak.png")
    assert (tmp_path / "soak.png").read_bytes().startswith(b"\x89PNG")
    path.write_text("\n".join(path.read_text().splitlines()[:10]))
    with pytest.raises(SettingsError, match="9 rows are too few, 20 are needed"):
        read_rows(path)
