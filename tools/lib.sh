# shellcheck shell=bash disable=SC2034
# What tools/run, tools/test and .ci/run share: messages, packages, configure and build. To be sourced by bash.
# After sourcing, the working directory is the top of the project; the one before is in started_in.

readonly started_in=$PWD
[ -z "${GEOFLOW_DATA:-}" ] || GEOFLOW_DATA=$(realpath -m -- "$GEOFLOW_DATA")
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1

# Exit codes of the scripts, as their --help says.
readonly exit_failed=1 exit_usage=2 exit_packages=3 exit_no_recording=4

say() { printf '== %s\n' "$*"; }

# die CODE SENTENCE…: to stderr, and out.
die() {
  local code=$1
  shift
  printf '%s: %s\n' "${0##*/}" "$*" >&2
  exit "$code"
}

# packages GROUP…: the names under those headings of tools/packages.txt.
packages() {
  local group
  for group in "$@"; do
    awk -v heading="[$group]" '/^\[/ { inside = ($0 == heading); next } inside && NF && !/^#/' tools/packages.txt
  done
}

# missing_packages GROUP…: those of them that this machine lacks.
missing_packages() {
  local name
  for name in $(packages "$@"); do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$name" 2>/dev/null)" = installed ] || echo "$name"
  done
}

# need_packages GROUP…: installs what is missing, as root or by sudo. Does nothing, and needs no network, when nothing is.
need_packages() {
  local missing become=()
  command -v dpkg-query >/dev/null || die "$exit_packages" "this needs Debian 12 (no dpkg here)"
  mapfile -t missing < <(missing_packages "$@")
  [ "${#missing[@]}" -eq 0 ] && return
  say "installing ${#missing[@]} Debian packages: ${missing[*]}"
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null ||
      die "$exit_packages" "not root and no sudo; ask an administrator for: apt-get install ${missing[*]}"
    become=(sudo)
  fi
  { "${become[@]}" apt-get update -qq &&
    "${become[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"; } ||
    die "$exit_packages" "apt-get could not install: ${missing[*]}"
}

# build PRESET [TARGET…] [-- CMAKE_OPTION…]: configures build/PRESET and builds the targets, or all.
build() {
  local preset=$1 targets=()
  shift
  while [ $# -gt 0 ] && [ "$1" != -- ]; do
    targets+=("$1")
    shift
  done
  [ $# -gt 0 ] && shift
  say "building build/$preset ${targets[*]}"
  export CMAKE_BUILD_PARALLEL_LEVEL=${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}
  local log=build/$preset.configure.log
  mkdir -p build
  cmake --preset "$preset" "$@" >"$log" 2>&1 || { cat "$log"; die "$exit_failed" "configuring build/$preset failed"; }
  cmake --build --preset "$preset" ${targets[@]:+--target "${targets[@]}"} ||
    die "$exit_failed" "building build/$preset failed"
}
