"""Downloads from a server on this machine: whole, damaged, interrupted."""

import contextlib
import hashlib
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from ico3d.cli import main
from ico3d.common.catalogue import table as room
from ico3d.common.catalogue.kinds import RemoteFile, Weights
from ico3d.common.downloads import fetching
from ico3d.common.downloads.fetching import git_blob
from ico3d.errors import DownloadError

pytestmark = pytest.mark.slow

DATA = b"\x08" + hashlib.shake_256(b"weights").digest(300_000)
SHA256 = hashlib.sha256(DATA).hexdigest()


def fetch_file(file, folder, most=1 << 20):
    return fetching.fetch_file(file, folder, most)


class Host(ThreadingHTTPServer):
    """Serves DATA; may hang up early or ignore ranges."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.sends, self.ranges, self.asked = len(DATA), True, []
        self.headers: dict[str, str] = {}


class Handler(BaseHTTPRequestHandler):
    def do_GET(self):
        asked = self.headers.get("Range", "")
        self.server.asked.append(asked)
        if "missing" in self.path:
            self.send_error(404)
            return
        body = b"<html>sorry</html>" if "sorry" in self.path else DATA
        first = int(asked[6:-1]) if asked and self.server.ranges else 0
        if first >= len(body):
            self.send_error(416)
            return
        self.send_response(206 if first else 200)
        headers = {"Content-Length": str(len(body) - first)} | self.server.headers
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if "endless" in self.path:
            with contextlib.suppress(OSError):
                while True:
                    self.wfile.write(DATA)
        self.wfile.write(body[first : self.server.sends])

    def log_message(self, *_):
        pass


@pytest.fixture
def host():
    server = Host()
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()


def url(host, name="a.onnx"):
    return f"http://127.0.0.1:{host.server_port}/files/{name}?raw=1"


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("digits", [64, 8, 0])
def test_a_good_file_arrives_under_its_name(host, tmp_path, digits):
    path = fetch_file(RemoteFile("b.onnx", url(host), SHA256[:digits]), tmp_path)
    assert path.read_bytes() == DATA
    assert names(tmp_path) == ["b.onnx"]


def test_git_blob_ids_are_gits(host, tmp_path):
    (tmp_path / "hello").write_bytes(b"hello\n")
    assert git_blob(tmp_path / "hello") == "ce013625030ba8dba906f756967f9e9ca394464a"
    blob = hashlib.sha1(b"blob %d\0" % len(DATA) + DATA).hexdigest()
    fetch_file(RemoteFile("b.onnx", url(host), git_blob=blob), tmp_path)
    with pytest.raises(DownloadError, match="not the file it should be"):
        fetch_file(RemoteFile("c.onnx", url(host), git_blob=SHA256[:40]), tmp_path)
    assert names(tmp_path) == ["b.onnx", "hello"]


@pytest.mark.parametrize(
    ("name", "checksum", "says"),
    [
        ("a.onnx", "0" * 64, r"not the file it should be \([0-9a-f]{12}, not 0{12}\)"),
        ("sorry.onnx", "", "something that is no b.onnx"),
        ("missing.onnx", "", "404"),
    ],
)
def test_another_file_is_refused_and_removed(host, tmp_path, name, checksum, says):
    with pytest.raises(DownloadError, match=says):
        fetch_file(RemoteFile("b.onnx", url(host, name), checksum), tmp_path)
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "length", "most"),
    [
        ("a.onnx", str(10**30), len(DATA) - 1),
        ("a.onnx", "300001", len(DATA) - 1),
        ("endless.onnx", "", 600_000),
        ("endless.onnx", "a lot", 600_000),
    ],
)
@pytest.mark.parametrize("have", [0, 9])
def test_a_server_sends_no_more_than_a_file_has(host, tmp_path, name, length, most, have):
    (tmp_path / f".{name}.part").write_bytes(DATA[:have])
    host.headers, host.ranges = {"Content-Length": length}, have > 0
    with pytest.raises(DownloadError, match=rf"more than {most:,} bytes\): it was deleted"):
        fetch_file(RemoteFile("b.onnx", url(host, name), SHA256), tmp_path, most)
    assert names(tmp_path) == []


def test_a_part_that_is_larger_than_the_file_is_removed(host, tmp_path):
    (tmp_path / ".a.onnx.part").write_bytes(bytes(len(DATA) - 1))
    with pytest.raises(DownloadError, match="it was deleted"):
        fetch_file(RemoteFile("b.onnx", url(host), SHA256), tmp_path, len(DATA) - 2)
    assert names(tmp_path) == []


def test_what_is_sent_packed_is_refused(host, tmp_path):
    host.headers = {"Content-Encoding": "gzip"}
    with pytest.raises(DownloadError, match=r"is sent packed \(gzip\)"):
        fetch_file(RemoteFile("b.onnx", url(host)), tmp_path)
    assert names(tmp_path) == []


def test_the_catalogue_bounds_what_its_files_are(host, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)
    host.headers = {"Content-Length": ""}
    file = RemoteFile("b.onnx", url(host, "endless.onnx"), SHA256)
    one = Weights("one", "a test", 3, "MIT", (file,))
    monkeypatch.setitem(room.TABLE, "one", one)
    with pytest.raises(DownloadError, match="more than 1,048,582 bytes"):
        fetching.fetch(one)


@pytest.mark.parametrize("ranges", [True, False])
def test_an_interrupted_download_goes_on(host, tmp_path, ranges):
    file = RemoteFile("b.onnx", url(host), SHA256)
    host.sends, host.ranges = 200_001, ranges
    with pytest.raises(DownloadError, match=r"after 200,001 of 300,001 bytes"):
        fetch_file(file, tmp_path)
    assert names(tmp_path) == [".a.onnx.part"]
    host.sends = len(DATA)
    assert fetch_file(file, tmp_path).read_bytes() == DATA
    assert host.asked == ["", "bytes=200001-"]
    assert names(tmp_path) == ["b.onnx"]


def test_a_part_that_was_already_whole_is_only_checked(host, tmp_path):
    (tmp_path / ".a.onnx.part").write_bytes(DATA)
    assert fetch_file(RemoteFile("b.onnx", url(host), SHA256), tmp_path).read_bytes() == DATA


def test_without_a_checksum_it_starts_again(host, tmp_path):
    (tmp_path / ".a.onnx.part").write_bytes(b"of another version")
    assert fetch_file(RemoteFile("b.onnx", url(host)), tmp_path).read_bytes() == DATA
    assert host.asked == [""]


def test_the_verb_fetches_once(host, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)
    files = (RemoteFile("b.onnx", url(host), SHA256), RemoteFile("c.onnx", url(host), SHA256))
    monkeypatch.setitem(room.TABLE, "two", Weights("two", "a test", 600_000, "MIT", files))
    for _ in range(2):
        assert main(["weights", "fetch", "two"]) == 0
        assert f"two is here: {tmp_path / '.cache' / 'ico3d' / 'models'}" in capsys.readouterr().out
    assert len(host.asked) == 2


def test_pytorch_files_become_safetensors(host, tmp_path, monkeypatch):
    torch = pytest.importorskip("torch")
    from safetensors.torch import load_file

    state = {
        "features.0.weight": torch.arange(6.0).reshape(2, 3).T,
        "classifier.0.bias": torch.ones(2),
    }
    torch.save(state, tmp_path / "net.pth")
    monkeypatch.setattr(f"{__name__}.DATA", (tmp_path / "net.pth").read_bytes())
    host.sends = len(DATA)
    file = RemoteFile("net.safetensors", url(host, "net.pth"), keep="features.")
    found = load_file(fetch_file(file, tmp_path / "models"))
    assert list(found) == ["features.0.weight"]
    torch.testing.assert_close(found["features.0.weight"], state["features.0.weight"])
    assert names(tmp_path / "models") == ["net.safetensors"]


def test_a_repository_comes_through_the_hubs_client(tmp_path, monkeypatch):
    package = pytest.importorskip("huggingface_hub")
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    asked = []

    def snapshot_download(repository, allow_patterns):
        asked.append((repository, allow_patterns))
        if len(asked) == 1:
            raise OSError("no network\nand more")
        folder = tmp_path / "tiny"
        folder.mkdir()
        (folder / "model.bin").touch()

    monkeypatch.setattr(package, "snapshot_download", snapshot_download)
    tiny = Weights("tiny", "a test", 1, "MIT", repository="some/tiny", wanted=("model.bin",))
    monkeypatch.setitem(room.TABLE, "tiny", tiny)
    assert main(["weights", "fetch", "tiny"]) == 1
    assert main(["weights", "fetch", "tiny"]) == 0
    assert asked == [("some/tiny", ["model.bin"])] * 2
