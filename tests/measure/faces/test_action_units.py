"""AUE of small tables against values computed by hand, and what is no table of OpenFace."""

import tracemalloc

import numpy as np
import pytest

from ico3d.errors import CaptureError
from ico3d.measure.faces import action_units
from ico3d.measure.faces.action_units import (
    LOWER,
    UPPER,
    action_unit_error,
    read_action_units,
)
from ico3d.measure.faces.blendshapes import blendshape_error

UNITS = sorted(LOWER + UPPER)


def write_table(path, values, seen=None, blank=" "):
    """A table of OpenFace: values by unit, one for each frame; units that are not given are 0."""
    count = len(next(iter(values.values())))
    names = ["frame", "face_id", "timestamp", "confidence", "success"]
    names += [f"{unit}_r" for unit in UNITS] + ["AU28_c"]
    lines = [("," + blank).join(names)]
    for frame in range(count):
        ok = 1 if seen is None else seen[frame]
        units = [values.get(unit, [0.0] * count)[frame] for unit in UNITS]
        row = [frame + 1, 0, frame / 25, 0.98, ok, *units, 1]
        lines.append(("," + blank).join(map(str, row)))
    path.write_text("\n".join(lines) + "\n")
    return path


def test_aue_is_the_sum_over_units_of_mean_squares(tmp_path):
    truth = write_table(tmp_path / "truth.csv", {"AU12": [1.0, 2.0, 3.0], "AU45": [0.0, 1.0, 0.0]})
    ours = write_table(
        tmp_path / "ours.csv",
        {"AU12": [1.0, 4.0, 0.0], "AU25": [0.5, 0.5, 0.5], "AU45": [3.0, 1.0, 0.0]},
        blank="",
    )
    found = action_unit_error(read_action_units(ours), read_action_units(truth))
    assert found.lower == pytest.approx((0 + 4 + 9) / 3 + 0.25)
    assert found.upper == pytest.approx(9 / 3)
    assert found.frames == 3
    assert len(LOWER) == 9 and len(UPPER) == 8 and not set(LOWER) & set(UPPER)


def test_frames_without_a_face_in_either_table_do_not_count(tmp_path):
    truth = read_action_units(
        write_table(tmp_path / "a.csv", {"AU26": [1.0, 9.0, 2.0, 5.0]}, seen=[1, 0, 1, 1])
    )
    ours = read_action_units(
        write_table(tmp_path / "b.csv", {"AU26": [2.0, 0.0, 2.0]}, seen=[1, 1, 1])
    )
    found = action_unit_error(ours, truth)
    assert (found.lower, found.frames) == (pytest.approx(0.5), 2)
    nobody = read_action_units(write_table(tmp_path / "c.csv", {"AU26": [1.0]}, seen=[0]))
    with pytest.raises(CaptureError, match="no frame with a face in common"):
        action_unit_error(nobody, truth)


@pytest.mark.parametrize(
    ("contents", "says"),
    [
        ("", "no column AU10_r"),
        ("frame, success\n1, 1\n", "no column AU10_r"),
        (", ".join(f"{unit}_r" for unit in UNITS) + "\n" + "x, " * 16 + "y\n", "17 numbers"),
        (", ".join(f"{unit}_r" for unit in UNITS) + "\n", "no rows of 17 numbers"),
        ("1" * 200_000, "field larger than field limit"),
    ],
)
def test_what_is_no_table_is_one_sentence(tmp_path, contents, says):
    (tmp_path / "au.csv").write_text(contents)
    with pytest.raises(CaptureError, match=says):
        read_action_units(tmp_path / "au.csv")


def test_blendshapes_are_compared_by_the_same_formula():
    names = ("_neutral", "jawOpen", "mouthClose", "browInnerUp", "eyeBlinkLeft", "noseSneerRight")
    truth = np.zeros((3, 6))
    ours = truth.copy()
    ours[:2] = (0.9, 0.3, 0.1, 0.2, 0.0, 0.4), (0.9, 0.1, 0.1, 0.0, 0.6, 0.4)
    ours[2] = np.nan
    found = blendshape_error(ours, truth, names)
    assert found is not None
    assert found.lower == pytest.approx((0.09 + 0.01) / 2 + 0.01)
    assert found.upper == pytest.approx(0.04 / 2 + 0.36 / 2 + 0.16)
    assert blendshape_error(ours[2:], truth[2:], names) is None


def test_a_table_of_empty_lines_takes_no_memory(tmp_path):
    """Each became a list: 75 bytes of memory for one of the file."""
    path = write_table(tmp_path / "a.csv", {"AU12": [1.0, 2.0]})
    whole = path.read_text().replace("\n", "\n" + "\n" * 500_000, 1)
    path.write_text(whole)
    tracemalloc.start()
    assert read_action_units(path).frames.tolist() == [1, 2]
    assert tracemalloc.get_traced_memory()[1] < 16 << 20
    tracemalloc.stop()


def test_a_table_too_long_is_refused_and_not_cut(tmp_path, monkeypatch):
    path = write_table(tmp_path / "a.csv", {"AU12": [1.0, 2.0, 3.0]})
    monkeypatch.setattr(action_units, "MOST_ROWS", 4)
    assert read_action_units(path).frames.tolist() == [1, 2, 3]
    monkeypatch.setattr(action_units, "MOST_ROWS", 3)
    with pytest.raises(CaptureError, match="more than 3 rows"):
        read_action_units(path)
