#!/bin/sh
# Makes .venv from requirements.lock when it is missing or stale: tools/setup.sh PYTHON
#
# Two stamps inside .venv, each written last so that an interrupted run counts as stale:
#   stamp-lock     lock, Python and place: a change makes the environment anew, so that
#                  packages which left the lock do not linger
#   stamp-package  pyproject.toml: a change installs the package alone again
set -eu

cd "$(dirname "$0")/.."
venv=.venv
python=${1:-}

new_enough='import sys; sys.exit(sys.version_info < (3, 11))'
if [ -z "$python" ] || ! "$python" -c "$new_enough" 2>/dev/null; then
    echo "sainet needs Python 3.11 or later and found ${python:-none}." \
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

# Says whether the stamp $1 holds the fingerprint $2.
fresh() {
    [ -x "$venv/bin/python" ] && [ "$(cat "$venv/$1" 2>/dev/null)" = "$2" ]
}

lock=$(fingerprint requirements.lock)
package=$(fingerprint pyproject.toml)

if ! fresh stamp-lock "$lock"; then
    version=$("$python" -c 'import platform; print(platform.python_version())')
    echo "Making $venv with Python $version from requirements.lock (a minute or two) ..."
    rm -f "$venv/stamp-lock" "$venv/stamp-package"
    if ! "$python" -m venv --clear "$venv"; then
        echo "$python cannot make a virtual environment;" \
             "on Debian: apt-get install python3-venv" >&2
        exit 1
    fi
    if ! "$venv/bin/python" -m pip install -qq --disable-pip-version-check \
        --require-hashes -r requirements.lock
    then
        echo "requirements.lock was made on Python 3.11 and did not install on $version:" \
             "see pip's lines above. If they say that no version matches, name another" \
             "Python: make setup PYTHON=python3.11" >&2
        exit 1
    fi
    echo "$lock" > "$venv/stamp-lock"
fi

if ! fresh stamp-package "$package"; then
    rm -f "$venv/stamp-package"
    # hatchling comes from the lock, so nothing unhashed is fetched to build with.
    "$venv/bin/python" -m pip install -qq --disable-pip-version-check \
        --no-deps --no-build-isolation --editable .
    echo "$package" > "$venv/stamp-package"
    echo "$venv is ready: .venv/bin/sainet --help"
fi
