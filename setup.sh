#!/usr/bin/env bash
# Install everything patchlaw needs on a Debian machine (12 or newer), then the package itself into .venv.
# With --instruments also the readers of instruments' formats, with --docs what makes the documentation.
# Run it as root or with sudo at hand; when all is there it does nothing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

# Compiled parts come from Debian, built against one MPI, one PETSc and one numpy.
packages=(
  python3 python3-venv python3-pip
  python3-dolfinx python3-petsc4py python3-mpi4py python3-gmsh
  python3-numpy python3-scipy python3-h5py python3-matplotlib
  mpi-default-bin libopenblas0-pthread gcc libc6-dev
)
# SurfaceTopography reads instruments' formats. What it is compiled against, and all else that Debian
# has, comes from Debian: pip would follow its requirements to a numpy that nothing here is built for.
instrument_packages=(
  python3-dateutil python3-defusedxml python3-olefile python3-openpyxl python3-pandas python3-pil
  python3-requests python3-tifffile python3-xmltodict python3-yaml python3-zstandard
)
instrument_wheels=(SurfaceTopography==1.27.1 NuMPI==0.18.1 array-api-compat==1.16.0 igor2==0.5.15)
docs_packages=(libjs-katex) # shows the equations
python=/usr/bin/python3 # dolfinx belongs to Debian's interpreter; another python3 may come first on PATH
stamp=.venv/patchlaw-ready

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$*" >&2; exit 1; }

# Once asked for, an option stays: a later plain ./setup.sh keeps it.
instruments=$(grep -so -- --instruments "$stamp" || true)
docs=$(grep -so -- --docs "$stamp" || true)
for option in "$@"; do
  case "$option" in
    --instruments) instruments=$option ;;
    --docs) docs=$option ;;
    *) fail "unknown option $option (allowed: --instruments, --docs)" ;;
  esac
done
[ -z "$instruments" ] || packages+=("${instrument_packages[@]}")
[ -z "$docs" ] || packages+=("${docs_packages[@]}")

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done

if [ ${#missing[@]} -gt 0 ]; then
  command -v apt-get >/dev/null || fail "this needs Debian's packages (${missing[*]}), and there is no apt-get here; elsewhere, with Python 3.12 or newer: pip install '.[fenicsx]' (docs/install.md)"
  if [ "$(id -u)" -eq 0 ]; then as_root=(); elif command -v sudo >/dev/null; then as_root=(sudo); else
    fail "these packages are missing, and neither root nor sudo is at hand. Ask an administrator for: apt-get install ${missing[*]}"
  fi
  say "installing ${missing[*]}"
  "${as_root[@]}" apt-get update -q || say "apt-get update failed; trying with the package lists at hand"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" ||
    fail "apt-get could not install: ${missing[*]}"
fi

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "$python is older than Python 3.11; Debian 12 or newer is needed"

# The stamp ties the environment to this checkout, this interpreter and these requirements.
wanted="$PWD $("$python" --version) $(sha256sum pyproject.toml) ${instruments:+$instruments ${instrument_wheels[*]}} $docs"
if [ ! -x .venv/bin/patchlaw ] || [ "$(cat "$stamp" 2>/dev/null)" != "$wanted" ]; then
  say "making .venv"
  "$python" -m venv --clear --system-site-packages .venv || fail "could not make .venv with $python"
  .venv/bin/python -m pip install --quiet --disable-pip-version-check --editable ".[beside-dolfinx,test${docs:+,docs}]" ||
    fail "pip could not install patchlaw and its pure-Python requirements (is a package index reachable?)"
  .venv/bin/python -c 'import dolfinx, petsc4py, mpi4py, gmsh, h5py, scipy, matplotlib, jinja2, pint, pydantic, rich, shtab, threadpoolctl, lazy_loader' ||
    fail "the installed packages cannot be imported together; see the message above"
  if [ "$instruments" ]; then
    say "installing readers of instruments' formats"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --only-binary :all: \
      "${instrument_wheels[@]}" || fail "pip could not install: ${instrument_wheels[*]}"
    .venv/bin/python -c 'import SurfaceTopography' || fail "SurfaceTopography cannot be imported; see the message above"
  fi
  # The package as it is installed, for type checkers: they do not follow the map in pyproject.toml.
  mkdir -p .venv/links/patchlaw
  for part in patchlaw/* geometry macro micro multiscale support; do ln -sfn "../../../$part" .venv/links/patchlaw/; done
  printf '%s\n' "$wanted" >"$stamp"
fi
say "ready: .venv/bin/patchlaw"
[ -z "$docs" ] || say "the documentation: .venv/bin/python -m sphinx -W -c docs . docs/_build, then docs/_build/index.html"
