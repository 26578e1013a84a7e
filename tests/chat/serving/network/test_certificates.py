"""Certificates that this machine makes, keeps and renews, and those from files."""

import contextlib
import ipaddress
import os
import ssl
import stat
from datetime import UTC, datetime, timedelta

import pytest
from cryptography import x509

from ico3d.chat.serving.network.certificates import (
    NAME,
    given_certificate,
    hosts_of,
    own_certificate,
    state_folder,
)
from ico3d.errors import SettingsError

NOW = datetime(2026, 5, 1, 12, tzinfo=UTC)
HOSTS = ["localhost", "box.local", "192.168.1.20", "::1"]


def read(folder):
    return x509.load_pem_x509_certificate((folder / NAME).read_bytes())


def handshake(certificate, host):
    """A TLS handshake in memory with a client that trusts only this certificate."""
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(certificate.file, certificate.key)
    client = ssl.create_default_context(cafile=certificate.file)
    client.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [
        client.wrap_bio(to_client, to_server, server_hostname=host),
        server.wrap_bio(to_server, to_client, server_side=True),
    ]
    for _ in range(4):
        for end in ends:
            with contextlib.suppress(ssl.SSLWantReadError):
                end.do_handshake()


def test_a_certificate_is_made_once_and_kept(tmp_path):
    folder = tmp_path / "state" / "tls"
    first = own_certificate(folder, HOSTS, NOW)
    again = own_certificate(folder, ["BOX.local"], NOW + timedelta(days=300))
    assert again.fingerprint == first.fingerprint and first.own
    assert sorted(hosts_of(read(folder))) == sorted(HOSTS)
    assert set(first.names) == {"localhost", "box.local"}
    assert stat.S_IMODE(os.stat(folder / NAME).st_mode) == 0o600
    assert stat.S_IMODE(os.stat(folder).st_mode) == 0o700
    assert os.listdir(folder) == [NAME]
    names = read(folder).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert ipaddress.ip_address("192.168.1.20") in names.get_values_for_type(x509.IPAddress)


@pytest.mark.parametrize("host", HOSTS)
def test_clients_that_trust_it_accept_it_for_its_hosts_only(tmp_path, host):
    certificate = own_certificate(tmp_path, HOSTS, datetime.now(UTC))
    handshake(certificate, host)
    with pytest.raises(ssl.SSLCertVerificationError):
        handshake(certificate, "elsewhere.example")


def test_it_is_renewed_before_it_expires_for_the_hosts_of_now(tmp_path):
    first = own_certificate(tmp_path, HOSTS, NOW)
    renewed = own_certificate(tmp_path, ["localhost", "10.0.0.7"], NOW + timedelta(days=385))
    assert renewed.fingerprint != first.fingerprint
    assert sorted(hosts_of(read(tmp_path))) == ["10.0.0.7", "localhost"]
    assert read(tmp_path).not_valid_after_utc > NOW + timedelta(days=385 + 390)


def test_another_network_adds_its_address(tmp_path):
    own_certificate(tmp_path, HOSTS, NOW)
    both = own_certificate(tmp_path, ["localhost", "10.0.0.7"], NOW + timedelta(days=1))
    assert sorted(hosts_of(read(tmp_path))) == sorted([*HOSTS, "10.0.0.7"])
    home = own_certificate(tmp_path, HOSTS, NOW + timedelta(days=2))
    assert home.fingerprint == both.fingerprint


@pytest.mark.parametrize("broken", [b"", b"no certificate", None])
def test_what_is_damaged_is_made_anew(tmp_path, broken):
    first = own_certificate(tmp_path, HOSTS, NOW)
    file = tmp_path / NAME
    text = file.read_bytes()
    file.write_bytes(text[: len(text) // 2] if broken is None else broken)
    again = own_certificate(tmp_path, HOSTS, NOW)
    assert again.fingerprint != first.fingerprint
    assert stat.S_IMODE(os.stat(file).st_mode) == 0o600


def test_a_key_that_others_could_read_is_made_anew(tmp_path):
    first = own_certificate(tmp_path, HOSTS, NOW)
    (tmp_path / NAME).chmod(0o644)
    again = own_certificate(tmp_path, HOSTS, NOW)
    assert again.fingerprint != first.fingerprint
    assert stat.S_IMODE(os.stat(tmp_path / NAME).st_mode) == 0o600


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(SettingsError, match=r"cannot be kept in .*XDG_STATE_HOME"):
        own_certificate(tmp_path / "file" / "tls", HOSTS, NOW)


def test_the_state_folder_can_be_chosen(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert state_folder() == tmp_path / "ico3d" / "tls"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert str(state_folder()) == "/home/somebody/.local/state/ico3d/tls"


def test_a_certificate_from_files(tmp_path):
    made = own_certificate(tmp_path, HOSTS, NOW)
    given = given_certificate(made.file, made.file, NOW)
    assert not given.own and given.fingerprint == made.fingerprint


def test_files_that_cannot_be_used_are_refused(tmp_path):
    one = own_certificate(tmp_path / "one", HOSTS, NOW).file
    other = own_certificate(tmp_path / "other", HOSTS, NOW).file
    with pytest.raises(SettingsError, match=r"cannot be used together .*KEY_VALUES_MISMATCH"):
        given_certificate(one, other, NOW)
    with pytest.raises(SettingsError, match="No such file"):
        given_certificate(tmp_path / "none.pem", one, NOW)
    with pytest.raises(SettingsError, match="valid only from 2026-04-30 to 2027-06-01"):
        given_certificate(one, one, NOW + timedelta(days=400))
