#!/usr/bin/env python3
"""Runs clang-tidy-19 over the project's sources.  Usage: tools/check/tidy.py [--all] [--jobs N] [FILE...]

Without FILE: the sources that changed against main (with those that include a changed header); --all: every source. Needs
build/clang configured (cmake --preset clang). A source that passed is not looked at again, in any work tree of this
user's, until it, a header of the project that it includes, its compile command or a .clang-tidy changes.
"""
import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import source

TOP = Path(source.top_of(__file__))
BUILD = TOP / "build/clang"
PASSED = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "geoflow-tidy"
SCOPE = TOP / "tools/check/own_scope.cpp"
CONFIGURATIONS = sorted([TOP / ".clang-tidy", *TOP.glob("[a-z]*/.clang-tidy")])
# The analyser's paths through one function: beyond these, Eigen's and fmt's inlined depths take three quarters of all time.
ANALYSER = [f"--extra-arg={word}" for word in ("-Xclang", "-analyzer-config", "-Xclang", "max-nodes=50000")]


def run(*command):
    return subprocess.run(command, cwd=TOP, capture_output=True, text=True, check=False)


@cache
def included(path):
    """What a file includes in quotes: the project's own files are included so, and only they."""
    return re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(errors="replace"), re.MULTILINE)


def own_files(entry):
    """The project's own files that one compile command reads, the source itself included."""
    folders = [Path(folder) for folder in re.findall(r"-I\s*(\S+)", entry["command"])]
    found, left = set(), [Path(entry["file"])]
    while left:
        path = left.pop()
        found.add(path)
        candidates = [folder / name for name in included(path) for folder in (path.parent, *folders)]
        left += [known for known in map(Path.resolve, candidates) if known not in found and known.is_file()]
    return sorted(found)


def prepare(entries):
    """Builds the plugin that keeps clang-tidy out of other libraries' headers, and the precompiled headers; the plugin's
    path."""
    precompiled = [re.search(r" -o (\S+)", entry["command"])[1] for entry in entries
                   if entry["file"].endswith("cmake_pch.hxx.cxx")]
    made = run("cmake", "--build", str(BUILD), "--target", "own_scope", *precompiled)
    if made.returncode != 0:
        sys.exit(made.stdout + made.stderr)
    return BUILD / "tools/check/own_scope.so"


def digest(entry, files):
    """Of all that decides what clang-tidy says of this source."""
    state = hashlib.sha256(" ".join([entry["command"].replace(str(TOP), "."), *ANALYSER]).encode())
    for path in [*files, SCOPE, *CONFIGURATIONS]:
        state.update(path.read_bytes())
    return state.hexdigest()


def sources_of(entries):
    """The project's sources, each once with all of its compile commands: clang-tidy runs under every one of them."""
    commands = {}
    for entry in entries:
        path = Path(entry["file"])
        if path.is_relative_to(TOP) and not path.is_relative_to(TOP / "build"):
            commands.setdefault(entry["file"], []).append(entry["command"])
    return [{"file": file, "command": " ".join(of_file)} for file, of_file in commands.items()]


def changed_files():
    """Files that differ from main or are new."""
    base = run("git", "merge-base", "HEAD", "main").stdout.strip() or "HEAD"
    names = run("git", "diff", "--name-only", base).stdout.splitlines()
    names += run("git", "ls-files", "--others", "--exclude-standard").stdout.splitlines()
    return {TOP / name for name in names}


def tidy(entry, wanted, plugin):
    """(file, output) where clang-tidy complains; None where it passes or the source is not wanted."""
    files = own_files(entry)
    if wanted is not None and not wanted.intersection(files):
        return None
    mark = PASSED / digest(entry, files)
    if mark.exists():
        return None
    done = run("clang-tidy-19", f"--load={plugin}", "--quiet", "-p", str(BUILD), *ANALYSER, entry["file"])
    if done.returncode == 0:
        mark.touch()
        return None
    return os.path.relpath(entry["file"], TOP), done.stdout + done.stderr


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="every source, not only the changed ones")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("files", nargs="*", metavar="FILE")
    arguments = parser.parse_args()
    database = BUILD / "compile_commands.json"
    if not database.is_file():
        sys.exit(f"{database}: missing; run cmake --preset clang")
    PASSED.mkdir(parents=True, exist_ok=True)
    entries = json.loads(database.read_text())
    sources = sources_of(entries)
    wanted = None if arguments.all else changed_files()
    if arguments.files:
        wanted = {Path(name).resolve() for name in arguments.files}
    plugin = prepare(entries)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        complaints = []
        for found in pool.map(lambda entry: tidy(entry, wanted, plugin), sources):
            if found:
                complaints.append(found)
                print(found[1], flush=True)
    for file, _ in complaints:
        print(f"failed: {file}")
    print(f"tidy: {len(sources)} sources, {len(complaints)} with findings")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
