"""The files of `deploy/` fit ico3d and one another."""

import json
import re
import tomllib
from importlib.util import find_spec
from pathlib import Path

import jsonschema
import pytest
import yaml

from ico3d import cli
from ico3d.chat.observing.metrics import Monitor
from ico3d.chat.services import choose
from ico3d.chat.serving.running.ending import LONGEST
from ico3d.chat.settings.conversation import read_settings

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
KILLED = LONGEST + 5  # s: what is left must close, too
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
SERVICES = COMPOSE["services"]
OURS = {name: one for name, one in SERVICES.items() if one["image"] == "ico3d"}


def by_default(text):
    """A value of the compose file where no variable is set."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", text)


@pytest.mark.parametrize("name", OURS)
def test_compose_runs_commands_that_there_are(name):
    words = [by_default(word) for word in OURS[name]["command"]]
    verb = cli.verb_of(words)
    assert verb is not None
    cli.parsed(verb, words[len(verb.split()) :])


@pytest.mark.parametrize("name", SERVICES)
def test_compose_mounts_what_is_there(name):
    mounts = [by_default(mount) for mount in SERVICES[name].get("volumes", [])]
    folders = [mount.split(":")[0] for mount in mounts if mount.startswith("./")]
    assert all((DEPLOY / f).exists() for f in folders if f != "./avatars")
    named = {mount.split(":")[0] for mount in mounts if not mount.startswith("./")}
    assert named <= set(COMPOSE["volumes"])


@pytest.mark.parametrize("name", OURS)
def test_containers_may_do_little(name):
    one = OURS[name]
    assert one["read_only"] and one["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in one["security_opt"]
    assert "ports" not in one, "only Caddy reaches it"


@pytest.mark.parametrize("file", sorted((DEPLOY / "settings").glob("*.toml")), ids=lambda f: f.stem)
def test_settings_are_read_and_name_services_of_compose(file):
    settings = read_settings(file)
    choose(settings, {})
    hosts = re.findall(r'url = "http://([^:]+):(\d+)/', file.read_text())
    for host, port in hosts:
        assert SERVICES[host].get("hostname", host) == host
        told = [word for word in SERVICES[host].get("command", []) if word.startswith("--port=")]
        assert told in ([], [f"--port={port}"])


def test_nobody_is_killed_amid_a_sentence():
    assert int(OURS["server"]["stop_grace_period"].removesuffix("s")) >= KILLED
    unit = (DEPLOY / "ico3d@.service").read_text()
    assert int(re.search(r"^TimeoutStopSec=(\d+)$", unit, re.M)[1]) >= KILLED


def test_the_unit_runs_a_command_that_there_is():
    unit = (DEPLOY / "ico3d@.service").read_text()
    values = dict(re.findall(r"^(\w+)=(.*)$", (DEPLOY / "serve.env").read_text(), re.M))
    line = re.search(r"^ExecStart=\S+/ico3d (.*)$", unit, re.M)[1].replace("%i", "8765")
    words = [re.sub(r"\$\{(\w+)\}", lambda m: values[m[1]], word) for word in line.split()]
    assert cli.parsed("serve", words[1:]).name == ("avatar.example.org",)


def test_nothing_lies_where_servers_stand():
    """A runtime may read files beneath the folder in which it runs."""
    unit = (DEPLOY / "ico3d@.service").read_text()
    own = re.search(r"^RuntimeDirectory=(.+)$", unit, re.M)[1]
    assert f"\nWorkingDirectory=%t/{own}\n" in unit
    image = (DEPLOY / "Dockerfile").read_text().split("\nFROM")[-1]
    assert re.findall(r"^WORKDIR (.+)$", image, re.M) == ["/var/empty"]
    assert "/var/empty" not in str(COMPOSE)


def test_the_dashboard_shows_figures_that_there_are():
    there = set(re.findall(r"# TYPE (\w+)", Monitor().exposition().decode()))
    board = json.loads((DEPLOY / "monitoring/grafana/dashboard.json").read_text())
    asked = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    names = {name for expr in asked for name in re.findall(r"\b(?:ico3d|process)_\w+", expr)}
    assert {name.removesuffix("_bucket") for name in names} <= there
    source = yaml.safe_load((DEPLOY / "monitoring/grafana/prometheus.yaml").read_text())
    assert {panel["datasource"]["uid"] for panel in board["panels"]} == {
        source["datasources"][0]["uid"]
    }


def test_prometheus_asks_where_servers_publish():
    scraped = yaml.safe_load((DEPLOY / "monitoring/prometheus.yml").read_text())
    found = scraped["scrape_configs"][0]["dns_sd_configs"][0]
    assert f"--metrics-port={found['port']}" in OURS["server"]["command"]
    assert found["names"] == ["server"]


def test_the_image_is_made_of_what_there_is():
    lines = (DEPLOY / "Dockerfile.dockerignore").read_text().splitlines()
    kept = [line[1:] for line in lines if line.startswith("!")]
    assert all((ROOT / path).exists() for path in kept)
    text = (DEPLOY / "Dockerfile").read_text()
    extras = re.search(r"^ARG EXTRAS=(.*)$", text, re.M)[1].split(",")
    known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(extras) <= set(known)
    assert text.index("USER 10001") > text.rindex("FROM"), "servers do not run as root"


def test_ray_takes_the_cluster_file():
    spec = find_spec("ray")
    if spec is None:
        pytest.skip("Ray is not installed")
    schema = Path(spec.origin).parent / "autoscaler" / "ray-schema.json"
    cluster = yaml.safe_load((DEPLOY / "ray-cluster.yaml").read_text())
    jsonschema.validate(cluster, json.loads(schema.read_text()))
