"""What memory is free, of the machine or of a container."""

import psutil

from ico3d.common.unpacking import memory


def test_a_container_has_what_its_limit_leaves(tmp_path):
    for name, text in {"max": "1000", "current": "700", "stat": "anon 1\ninactive_file 50"}.items():
        (tmp_path / f"memory.{name}").write_text(text)
    assert memory._free_in_group(tmp_path) == 350
    (tmp_path / "memory.max").write_text("max\n")
    assert memory._free_in_group(tmp_path) is None
    assert 0 < memory.free_memory() <= psutil.virtual_memory().total
