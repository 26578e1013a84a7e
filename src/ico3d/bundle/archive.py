"""Reads a folder or an uncompressed zip as named files, on the assumption that it is hostile."""

import contextlib
import os
import re
import stat
import struct
import threading
import weakref
import zipfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from ico3d.bundle import limits
from ico3d.common.files import check_left, write_atomic
from ico3d.common.unpacking.zips import OtherEndError, directory
from ico3d.errors import BundleError

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,99}(/[A-Za-z0-9_][A-Za-z0-9_.\-]{0,99}){0,3}")
LOCAL_HEAD = struct.Struct("<26xHH")
"""What stands before a file in a zip, of which the lengths of name and extra fields count."""
_EPOCH = (1980, 1, 1, 0, 0, 0)


class Archive(ABC):
    """Named files and their sizes in bytes; names are checked before anything is read."""

    sizes: Mapping[str, int]

    @abstractmethod
    def read(self, name: str) -> bytes:
        """The content of the file `name`, a key of `sizes`.

        Raises:
            BundleError: If the file cannot be read, or its size has changed.
        """


def open_archive(path: Path) -> Archive:
    """Lists the files of a bundle.

    Raises:
        BundleError: If the path does not exist, or a name, link or zip entry is refused.
    """
    if os.path.isdir(path):
        return _Folder(path)
    if os.path.isfile(path):
        return _Zip(path)
    raise BundleError(f"there is no bundle at {path}.")


def write_zip(path: Path, files: Mapping[str, bytes]) -> None:
    """Writes a zip without compression, atomically; equal files give equal bytes.

    Raises:
        BundleError: If a name or size is not allowed, or no file can be written at the path.
        StorageError: If the disk has no room for it and some more.
    """
    sizes = {name: len(data) for name, data in files.items()}
    _check_names(list(sizes), path)
    _check_sizes(sizes, path)

    def written(temporary: Path) -> None:
        check_left(temporary.parent, path, sum(sizes.values()))
        _write_zip(temporary, files)

    try:
        if os.path.exists(path) and not os.path.isfile(path):
            raise BundleError(f"{path} is a folder or a device: name a file to write.")
        write_atomic(path, written)
    except OSError as error:
        raise BundleError(f"{path} cannot be written: {error.strerror}.") from error


def _write_zip(path: Path, files: Mapping[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, data in files.items():
            info = zipfile.ZipInfo(name, _EPOCH)
            info.create_system = 3  # Unix, wherever this runs
            info.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(info, data)


class _Folder(Archive):
    def __init__(self, path: Path):
        self.path = path
        sizes: dict[str, int] = {}
        try:
            for name, size in _walk(path, "", path):
                sizes[name] = size
                if len(sizes) > limits.MAX_FILES:
                    raise BundleError(f"{path}: holds more than {limits.MAX_FILES} files.")
        except OSError as error:
            raise BundleError(f"{path}: cannot be read ({error.strerror}).") from error
        _check_names(list(sizes), path)
        _check_sizes(sizes, path)
        self.sizes = sizes

    def read(self, name: str) -> bytes:
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
        flags |= getattr(os, "O_NONBLOCK", 0)  # a pipe in its place would be waited for
        try:
            with open(os.open(self.path / name, flags), "rb") as file:
                data = file.read(self.sizes[name] + 1)
        except OSError as error:
            raise BundleError(f"{name}: cannot be read ({error.strerror}).") from error
        return _whole(data, self.sizes[name], name)


class _Zip(Archive):
    def __init__(self, path: Path):
        with _reading(path.name):
            # kept open: what somebody puts in its place is another bundle, which nobody has checked
            self._file, self._lock = path.open("rb"), threading.Lock()
            weakref.finalize(self, self._file.close)
            _check_directory(self._file, path)
            with zipfile.ZipFile(self._file) as archive:
                entries = archive.infolist()
        _check_names([entry.orig_filename for entry in entries], path)
        for entry in entries:
            _check_entry(entry)
        self._entries = {entry.filename: entry for entry in entries}
        self.sizes = {entry.filename: entry.file_size for entry in entries}
        _check_sizes(self.sizes, path)
        if sum(self.sizes.values()) > os.fstat(self._file.fileno()).st_size:
            raise BundleError(f"{path.name}: its entries overlap.")

    def read(self, name: str) -> bytes:
        entry = self._entries[name]
        with _reading(name), self._lock:
            self._file.seek(entry.header_offset)
            head = self._file.read(LOCAL_HEAD.size)
            if len(head) < LOCAL_HEAD.size or not head.startswith(b"PK\3\4"):
                raise zipfile.BadZipFile("a file does not begin where the directory says")
            behind_names = sum(LOCAL_HEAD.unpack(head))
            self._file.seek(behind_names, os.SEEK_CUR)
            data = self._file.read(entry.file_size)
            if zlib.crc32(data) != entry.CRC:
                raise zipfile.BadZipFile("a file is not the one that was packed")
        return _whole(data, entry.file_size, name)


def _walk(folder: Path, prefix: str, root: Path) -> Iterator[tuple[str, int]]:
    """All regular files below a folder; deeper levels than names allow are refused."""
    with os.scandir(folder) as entries:
        for entry in entries:
            name = prefix + entry.name
            if entry.is_symlink():
                raise BundleError(f"{name}: links are not allowed in a bundle.")
            if entry.is_dir():
                if name.count("/") > 3:
                    raise BundleError(f"{name}: folders of a bundle must not be nested so deep.")
                yield from _walk(Path(entry.path), name + "/", root)
            elif entry.is_file():
                yield name, entry.stat().st_size
            else:
                raise BundleError(f"{name}: is not a regular file.")


def _check_directory(file: BinaryIO, path: Path) -> None:
    """Refuses what makes zipfile read a huge directory: the end record must be the plain one."""
    size = file.seek(0, os.SEEK_END)
    if size > limits.MAX_BUNDLE_BYTES:
        raise BundleError(f"{path.name}: is larger than {limits.MAX_BUNDLE_BYTES} bytes.")
    try:
        found = directory(file)
    except OtherEndError as error:
        raise BundleError(f"{path.name}: {error}.") from error
    if found.count > limits.MAX_FILES or found.length > limits.MAX_MANIFEST_BYTES:
        raise BundleError(f"{path.name}: holds more than {limits.MAX_FILES} files.")
    if found.far:
        raise BundleError(f"{path.name}: is a zip64 archive; no bundle is that large.")
    if found.start + found.length != found.end:
        raise BundleError(f"{path.name}: its directory is not where it should be.")


def _check_entry(entry: zipfile.ZipInfo) -> None:
    mode = entry.external_attr >> 16
    if stat.S_ISLNK(mode):
        raise BundleError(f"{entry.filename}: links are not allowed in a bundle.")
    if mode and stat.S_IFMT(mode) not in (0, stat.S_IFREG):
        raise BundleError(f"{entry.filename}: is not a regular file.")
    if entry.flag_bits & 0x1:
        raise BundleError(f"{entry.filename}: is encrypted.")
    if entry.compress_type != zipfile.ZIP_STORED or entry.compress_size != entry.file_size:
        raise BundleError(f"{entry.filename}: is compressed; a bundle's files must be stored.")


def _check_names(names: list[str], path: Path) -> None:
    seen: set[str] = set()
    for name in names:
        if not _NAME.fullmatch(name):
            raise BundleError(f"{path.name}: the file name {name[:80]!r} is not allowed.")
        if name.casefold() in seen:
            raise BundleError(f"{path.name}: the file name {name[:80]!r} occurs twice.")
        seen.add(name.casefold())


def _check_sizes(sizes: Mapping[str, int], path: Path) -> None:
    for name, size in sizes.items():
        aside = name.endswith((".txt", ".png"))
        most = limits.MAX_ASIDE_BYTES if aside else limits.MAX_FILE_BYTES
        if size > most:
            raise BundleError(f"{name}: is larger than {most} bytes.")
    if sum(sizes.values()) > limits.MAX_BUNDLE_BYTES:
        raise BundleError(f"{path.name}: is larger than {limits.MAX_BUNDLE_BYTES} bytes.")


def _whole(data: bytes, size: int, name: str) -> bytes:
    if len(data) != size:
        raise BundleError(f"{name}: has {len(data)} bytes where {size} were expected.")
    return data


@contextlib.contextmanager
def _reading(name: str) -> Generator[None, None, None]:
    """Whatever zipfile raises on damaged input becomes one sentence."""
    try:
        yield
    except (
        zipfile.BadZipFile,
        NotImplementedError,
        RuntimeError,
        EOFError,
        OSError,
        ValueError,
        struct.error,
    ) as error:
        raise BundleError(f"{name}: is damaged or cannot be read ({error}).") from error
