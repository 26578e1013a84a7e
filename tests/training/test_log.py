"""What others read of a run's metrics."""

from ico3d.training.log import METRICS, latest_entry


def test_latest_entry(tmp_path):
    """The last whole line, while somebody is writing the next, however long the file is."""
    assert latest_entry(tmp_path) is None
    file = tmp_path / METRICS
    file.write_text("")
    assert latest_entry(tmp_path) is None
    file.write_text('{"step": 0, "loss"')
    assert latest_entry(tmp_path) is None
    lines = [f'{{"step": {step}, "loss": 0.5}}\n' for step in range(1_000)]
    file.write_text("".join(lines) + '{"step": 10')
    assert latest_entry(tmp_path) == {"step": 999, "loss": 0.5}
