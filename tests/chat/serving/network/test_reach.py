"""Who can reach a server, and what its operator is told about it."""

import ipaddress
import socket
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import psutil
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from ico3d.chat.serving.guard import is_own
from ico3d.chat.serving.network import addresses, certificates, reach
from ico3d.chat.serving.network.certificates import given_certificate
from ico3d.chat.serving.network.reach import (
    Reach,
    as_seen,
    checked_name,
    find_reach,
    machine_names,
    qr_code,
)
from ico3d.errors import SettingsError


def interface(family, address):
    return SimpleNamespace(family=family, address=address)


@pytest.fixture
def interfaces(monkeypatch):
    """A machine with a network cable, a wireless network, and others that lead nowhere."""
    four, six = socket.AF_INET, socket.AF_INET6
    entries = {
        "lo": [interface(four, "127.0.0.1"), interface(six, "::1")],
        "eth0": [interface(four, "10.0.0.7"), interface(six, "fe80::1%eth0")],
        "wlan0": [interface(four, "192.168.1.20"), interface(six, "2001:db8::20")],
        "usb0": [interface(four, "169.254.3.4")],
        "off0": [interface(four, "172.16.0.1")],
    }
    stats = {name: SimpleNamespace(isup=name != "off0") for name in entries}
    monkeypatch.setattr(psutil, "net_if_addrs", lambda: entries)
    monkeypatch.setattr(psutil, "net_if_stats", lambda: stats)
    monkeypatch.setattr(addresses, "_outward", {four: "192.168.1.20", six: None}.get)
    monkeypatch.setattr(socket, "gethostname", lambda: "Box.lan")


@pytest.mark.usefixtures("interfaces")
def test_addresses_are_those_that_others_can_use():
    assert addresses.machine_addresses("0.0.0.0") == ["192.168.1.20", "10.0.0.7"]
    assert addresses.machine_addresses("::") == ["192.168.1.20", "10.0.0.7", "2001:db8::20"]
    assert addresses.machine_addresses("10.0.0.7") == ["10.0.0.7"]


def test_the_addresses_of_this_machine_are_addresses():
    for address in addresses.machine_addresses("0.0.0.0"):
        assert ipaddress.ip_address(address).version == 4


@pytest.mark.usefixtures("interfaces")
def test_a_phone_is_told_an_address_that_the_certificate_and_the_server_accept(tmp_path):
    found = find_reach("0.0.0.0", ["Avatar.example.org."], True, None, None, folder=tmp_path)
    assert found.urls(8765) == [
        "https://avatar.example.org:8765/",
        "https://192.168.1.20:8765/",
        "https://10.0.0.7:8765/",
        "https://box.local:8765/",
        "https://box:8765/",
    ]
    assert found.certificate is not None
    assert set(found.certificate.names) == {"avatar.example.org", "localhost", "box.local", "box"}
    for url in found.urls(8765):
        host = url.split("/")[2]
        assert is_own(host, url.rstrip("/"), "0.0.0.0", found.answered)
    assert not is_own("evil.example:8765", None, "0.0.0.0", found.answered)
    assert not is_own("box:8765", "https://evil.example:8765", "0.0.0.0", found.answered)
    told = "\n".join(found.told(8765, "abcd-efgh"))
    assert "who has the key gets in" in told and found.certificate.fingerprint in told
    assert all(f"{url}#key=abcd-efgh" in told for url in found.urls(8765))
    assert "\n".join(qr_code("https://avatar.example.org:8765/#key=abcd-efgh")) in told


@pytest.mark.usefixtures("interfaces")
def test_the_operator_is_told_who_can_reach_the_server():
    def told(host, names=(), key=None, **options):
        return " ".join(find_reach(host, names, False, None, None, **options).told(8765, key))

    alone = told("127.0.0.1")
    assert alone.startswith("Only this machine reaches it; --host") and "--proxy" not in alone
    assert told("127.0.0.1", key="").startswith("Only this machine reaches it; who has the key")
    tunnel = told("127.0.0.1", ["avatar.example.org"], "abcd-efgh")
    assert "tunnel lets through as avatar.example.org; who has the key gets in" in tunnel
    assert "the key is abcd-efgh" in tunnel and "limits per address do not hold" in tunnel
    proxied = told("127.0.0.1", ["avatar.example.org"], "", proxies=["127.0.0.1"])
    assert "the key is" not in proxied and "limits" not in proxied
    everybody = told("0.0.0.0", is_open=True)
    assert "everybody can talk: no key is asked for" in everybody
    assert "can only type" in everybody and "fingerprint" not in everybody
    behind = told("0.0.0.0", key="", proxies=["172.18.0.0/16"])
    assert "who has the key gets in" in behind and "can only type" not in behind


def test_a_key_does_not_travel_unencrypted():
    with pytest.raises(SettingsError, match=r"--tls, or --proxy ADDRESS .* or --open"):
        find_reach("0.0.0.0", [], False, None, None)


def test_strangers_behind_a_proxy_are_not_taken_for_users_of_this_machine(tmp_path):
    """Without a name they came as who is on this machine, and showed no key."""
    for tls in (False, True):
        with pytest.raises(SettingsError, match=r"--proxy 127.0.0.1: add --name"):
            find_reach("127.0.0.1", [], tls, None, None, ["127.0.0.1"], folder=tmp_path)
    assert find_reach("127.0.0.1", ["a.example"], False, None, None, ["127.0.0.1"]).is_public
    assert find_reach("0.0.0.0", [], False, None, None, ["172.18.0.0/16"]).is_public


def test_a_key_that_holds_up_everybody_is_told(tmp_path, monkeypatch):
    key = rsa.generate_private_key(65537, 2048)
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "avatar.example.org")])
    now = datetime.now(UTC)
    made = x509.CertificateBuilder(name, name, key.public_key(), 1, now, now + timedelta(days=1))
    file = tmp_path / "both.pem"
    file.write_bytes(
        made.sign(key, hashes.SHA256()).public_bytes(Encoding.PEM)
        + key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    )
    for bits, told in ((2048, False), (2047, True)):
        monkeypatch.setattr(certificates, "LONGEST_RSA", bits)
        certificate = given_certificate(file, file, now)
        reach = Reach("0.0.0.0", (), (), certificate)
        assert any("holds up everybody" in line for line in reach.told(8765, "")) is told


@pytest.mark.parametrize("proxy", ["proxy.example", "*", "", "0.0.0.0/0", "::/0", "10.0.0.1/8"])
def test_not_everybody_is_believed_where_he_comes_from(proxy):
    with pytest.raises(SettingsError, match="--proxy"):
        find_reach("127.0.0.1", [], False, None, None, proxies=[proxy])


@pytest.mark.parametrize("proxy", ["172.18.0.0/16", "172.18.3.4", "2001:db8::/64"])
def test_a_proxy_is_known_by_a_socket_of_both_families_too(proxy):
    trusted = ProxyHeadersMiddleware(None, as_seen([proxy])).trusted_hosts  # type: ignore[arg-type]
    four = proxy.startswith("172")
    assert ("::ffff:172.18.3.4" in trusted) is ("172.18.3.4" in trusted) is four
    assert ("2001:db8::7" in trusted) is not four
    assert not any(other in trusted for other in ("::ffff:172.19.3.4", "172.19.3.4", "::1"))


def test_a_given_certificate_brings_its_names_and_no_question(tmp_path):
    own = find_reach("127.0.0.1", ["avatar.example.org"], True, None, None, folder=tmp_path)
    assert own.certificate is not None
    file = own.certificate.file
    given = find_reach("127.0.0.1", [], False, file, file)
    assert given.names == ("avatar.example.org",) and given.scheme == "https"
    assert "fingerprint" not in " ".join(given.told(8765))
    with pytest.raises(SettingsError, match="both or neither"):
        find_reach("127.0.0.1", [], False, file, None)


@pytest.mark.parametrize("name", ["", "https://a.example", "a.example:80", "10.0.0.1", "-a", "a b"])
def test_what_is_no_host_name_is_refused(name):
    with pytest.raises(SettingsError, match="host name alone"):
        checked_name(name)


def test_names_of_a_machine():
    assert machine_names("Box.lan") == ("box.local", "box")
    assert machine_names("localhost") == machine_names("my_box") == ()


def test_a_qr_code_is_a_square_of_half_blocks_with_a_quiet_zone():
    lines = qr_code("https://192.168.1.20:8765/")
    assert {len(line) for line in lines} == {25 + 2 * reach.QUIET_ZONE}
    assert len(lines) == (25 + 2 * reach.QUIET_ZONE + 1) // 2
    assert set("".join(lines)) == set(" ▀▄█") and set(lines[0]) == {"█"}


def test_addresses_of_ipv6_are_written_as_in_urls():
    assert Reach("2001:db8::20").urls(80) == ["http://[2001:db8::20]:80/"]
