#!/bin/sh
# Makes .venv when it is missing or stale: tools/setup.sh PYTHON [base|dev]
#
#   base   what `sainet` itself needs, from requirements.lock
#   dev    also what tests and checks need, from requirements-dev.lock
#
# Three stamps inside .venv, each written last so that an interrupted run counts as stale:
#   stamp-base     lock, Python and place: a change makes the environment anew, so that
#   stamp-dev      packages which left a lock do not linger
#   stamp-package  pyproject.toml: a change installs the package alone again
set -eu

cd "$(dirname "$0")/.."
venv=.venv
python=${1:-}
wanted=${2:-base}

new_enough='import sys; sys.exit(sys.version_info < (3, 11))'
if [ -z "$python" ] || ! "$python" -c "$new_enough" 2>/dev/null; then
    echo "sainet needs Python 3.11 or later; found ${python:-none}." \
         "Install one, or name it: make setup PYTHON=/path/to/python3.11" >&2
    exit 1
fi

# Prints one hash of this Python, this place and the files named.
fingerprint() {
    "$python" -c '
import hashlib, os, pathlib, sys
digest = hashlib.sha256((sys.version + os.getcwd()).encode())
for name in sys.argv[1:]:
    digest.update(pathlib.Path(name).read_bytes())
print(digest.hexdigest())' "$@"
}

# Succeeds if the stamp $1 holds the fingerprint $2.
fresh() {
    [ -x "$venv/bin/python" ] && [ "$(cat "$venv/$1" 2>/dev/null)" = "$2" ]
}

size() { du -sm "$venv" | cut -f1; }

# Reads pip's lines and prints one for each of $1 packages; exits as pip did.
show_progress() {
    count=0
    while read -r word rest; do
        case "$word" in
        Collecting | Processing | Requirement)
            count=$((count + 1))
            name=${rest#already satisfied: }
            name=${name%% *}
            case "$name" in *.whl) name=${name##*/} name=${name%-*-*-*} ;; esac
            printf '\n  %3d/%s  %s' "$count" "$1" "$name" ;;
        Downloading | Using) printf ' %s' "${rest##* (}" | tr -d ')' ;;
        Ignoring) printf '\n  not for this Python: %s' "${rest%%: *}" ;;
        Installing) printf '\n  unpacking' ;;
        exit) printf '\n'; return "$rest" ;;
        esac
    done
}

# Installs the lock $1; pip's errors pass through. Bytecode is left to the first import:
# most of these modules are never imported, and compiling them takes as long as unpacking.
install() {
    printf '%s' "Installing $1:"
    {
        "$venv/bin/python" -m pip install --disable-pip-version-check --no-compile \
            --progress-bar off --require-hashes -r "$1" && echo exit 0 || echo exit 1
    } | show_progress "$(grep -c '==' "$1")" && return
    version=$("$python" -c 'import platform; print(platform.python_version())')
    echo "$1 was made on Python 3.11 and did not install on $version: see pip's lines" \
         "above. If they say that no version matches, name another Python:" \
         "make setup PYTHON=python3.11" >&2
    exit 1
}

base=$(fingerprint requirements.lock)
dev=$(fingerprint requirements-dev.lock)
package=$(fingerprint pyproject.toml)

stale=false
fresh stamp-base "$base" || stale=true
if [ -e "$venv/stamp-dev" ]; then fresh stamp-dev "$dev" || stale=true; fi

if $stale; then
    version=$("$python" -c 'import platform; print(platform.python_version())')
    echo "Making $venv with Python $version"
    rm -f "$venv"/stamp-*
    if ! "$python" -m venv --clear "$venv"; then
        echo "$python cannot make a virtual environment;" \
             "on Debian: apt-get install python3-venv" >&2
        exit 1
    fi
    install requirements.lock
    # Nothing here is built by setuptools; and nobody runs the packages' own tests, 50 MB.
    "$venv/bin/python" -m pip uninstall -qq -y --disable-pip-version-check setuptools
    find "$venv/lib" -type d -name tests -prune -exec rm -rf {} +
    echo "$base" > "$venv/stamp-base"
fi

if [ "$wanted" = dev ] && ! fresh stamp-dev "$dev"; then
    install requirements-dev.lock
    echo "$dev" > "$venv/stamp-dev"
fi

if ! fresh stamp-package "$package"; then
    rm -f "$venv/stamp-package"
    # hatchling comes from the lock, so nothing unhashed is fetched to build with.
    "$venv/bin/python" -m pip install -qq --disable-pip-version-check \
        --no-deps --no-build-isolation --editable .
    # Where bytecode is not written, as in many containers, every process would compile
    # all that it imports: once, at twice the time of the rest of its start.
    if [ -n "${PYTHONDONTWRITEBYTECODE:-}" ]; then
        env -u PYTHONDONTWRITEBYTECODE "$venv/bin/python" -c '
from importlib import import_module
from pkgutil import walk_packages
import sainet
for module in walk_packages(sainet.__path__, "sainet.", lambda name: None):
    try:
        import_module(module.name)
    except Exception:  # an extra is missing: what needs it says so when it is used
        pass
'
    fi
    echo "$package" > "$venv/stamp-package"
    echo "$venv is ready ($(size) MB): .venv/bin/sainet --help"
fi
