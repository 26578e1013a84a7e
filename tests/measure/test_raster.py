import json
import subprocess
import sys

import pytest

from ico3d.errors import SettingsError
from ico3d.measure.raster import compare
from support.shared import SHARED

pytestmark = pytest.mark.slow

OPPONENT = SHARED / "reference" / "raster_c" / "opponent.py"


@pytest.mark.skipif(not OPPONENT.is_file(), reason="the C++ opponent is not beside the repository")
def test_both_draw_the_same_picture(tmp_path):
    """In a process of its own: the opponent's -ffast-math would round tiny floats to 0 in this."""
    out = tmp_path / "raster.json"
    words = ["bench", "raster", "--against", str(OPPONENT), "--json", str(out)]
    words += ["--n", "2000", "--size", "96", "--runs", "2"]
    command = [sys.executable, "-m", "ico3d.cli", *words]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    figures = json.loads(out.read_text())
    [scene] = figures["scenes"]
    assert scene["image_difference"] < 1e-3
    assert scene["gradient_difference"] < 1e-3
    total = scene["ours_binning_ms"] + scene["ours_forward_ms"] + scene["ours_backward_ms"]
    assert scene["ours_total_ms"] == pytest.approx(total)
    theirs = scene["theirs_forward_ms"] + scene["theirs_backward_ms"]
    assert figures["ratio_2k_96"] == scene["ratio"] == pytest.approx(total / theirs)
    assert "2k_96" in printed


def test_what_is_no_opponent_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="names no Python file"):
        compare(tmp_path / "nothing.py", 10, 32, 1)
    (tmp_path / "empty.py").write_text("")
    with pytest.raises(SettingsError, match="is no opponent"):
        compare(tmp_path / "empty.py", 10, 32, 1)
    with pytest.raises(SettingsError, match="multiple of 16"):
        compare(tmp_path / "empty.py", 10, 33, 1)
