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


def test_the_tightest_limit_counts_of_a_group_and_its_parents_in_both_versions(tmp_path):
    pod = tmp_path / "pods" / "one"
    old = tmp_path / "memory" / "docker" / "two"
    for folder, files in ((pod, memory.VERSION_2), (old, memory.VERSION_1)):
        folder.mkdir(parents=True)
        for above, most in ((folder, "5000"), (folder.parent, "900")):
            (above / files[0]).write_text(most)
            (above / files[1]).write_text("100")
            (above / "memory.stat").write_text(f"anon 1\n{files[2]} 50\n")
    lines = "0::/pods/one\n4:cpu,cpuacct:/x\n3:memory:/docker/two\n"
    groups = list(memory._groups(lines, tmp_path))
    assert [group for group, _ in groups] == [
        *(pod, pod.parent, tmp_path),
        *(old, old.parent, tmp_path / "memory"),
    ]
    free = [memory._free_in_group(*group) for group in groups]
    assert free == [4950, 850, None, 4950, 850, None]
