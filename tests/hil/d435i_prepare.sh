#!/usr/bin/env bash
# d435i_prepare.sh BUILD DATA: the recording that the emulated camera plays in d435i_guest.py.
set -euo pipefail
exec "$1/bin/geoflow" simulate office -o "$2/office" --seed 1 --duration 1 --raw --reuse
