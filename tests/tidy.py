#!/usr/bin/env python3
"""clang-tidy over everything but tests and generated code, in parallel: tidy.py BUILD_DIR [--jobs N]

BUILD_DIR was configured for clang with CMAKE_UNITY_BUILD and CMAKE_UNITY_BUILD_BATCH_SIZE=0: all sources of a target are
read as one translation unit, because every check walks every header a unit sees, and one source at a time takes ten times
as long. A unit that passed before is not read again until one of its sources, a header of ours, its command or .clang-tidy
changes. Exit code 1 when clang-tidy finds anything.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
ROOMS = ("common", "server", "client")
# Without the precompiled header, which is much of what the checks would walk, and without sanitizers.
LEFT_OUT = re.compile(r" -Winvalid-pch| -Xclang -include(-pch)? -Xclang \S+| -fsanitize=\S+| -fno-sanitize-\S+")
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.MULTILINE)


def units(build):
    """Name -> entry of the compilation database, for each translation unit of our rooms."""
    found = {}
    for entry in json.loads((build / "compile_commands.json").read_text(encoding="utf-8")):
        path = pathlib.Path(entry["directory"], entry["file"]).resolve()
        base = build if build in path.parents else ROOT
        if base in path.parents and path.relative_to(base).parts[0] in ROOMS and path.suffix != ".c":
            found[path.relative_to(base).as_posix()] = {**entry, "command": LEFT_OUT.sub("", entry["command"])}
    return found


def sources(path, seen):
    """The file and everything of ours that it includes, directly or not."""
    if path in seen or not path.is_file():
        return seen
    seen.add(path)
    for include in INCLUDE.findall(path.read_text(encoding="utf-8")):
        sources(ROOT / include, seen)  # The sources of a unit are named by their whole paths.
    return seen


def digest(entry):
    summary = hashlib.sha256(entry["command"].encode())
    for part in [ROOT / ".clang-tidy", *sorted(sources(pathlib.Path(entry["file"]), set()))]:
        summary.update(str(part).encode() + b"\0" + part.read_bytes())
    return summary.hexdigest()


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("build", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    args = parser.parse_args()

    passed_file = args.build / "clang-tidy-passed.json"
    try:
        passed = json.loads(passed_file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        passed = {}
    entries = units(args.build)
    if not entries:
        sys.exit(f"{args.build}/compile_commands.json names no source of ours")
    read = {name: len([s for s in sources(pathlib.Path(entry["file"]), set()) if s.suffix == ".cpp"])
            for name, entry in entries.items()}
    entries = {name: entry for name, entry in entries.items() if read[name] > 0}  # Not what is generated.
    database = args.build / "clang-tidy"
    database.mkdir(exist_ok=True)
    (database / "compile_commands.json").write_text(json.dumps(list(entries.values())), encoding="utf-8")
    digests = {name: digest(entry) for name, entry in entries.items()}
    # The longest first, or they would be waited for at the end.
    todo = sorted((name for name in entries if passed.get(name) != digests[name]), key=read.get, reverse=True)

    def run(name):
        return name, subprocess.run(["clang-tidy", "--quiet", "-p", str(database), entries[name]["file"]],
                                    capture_output=True, text=True, check=False)

    found = []
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        for name, done in pool.map(run, todo):
            if done.returncode == 0:
                passed[name] = digests[name]
            else:
                found.append(name)
                print(done.stdout + re.sub(r"^\d+ warnings?.*\n|^Suppressed.*\n|^Use -header.*\n", "", done.stderr,
                                           flags=re.MULTILINE), flush=True)
    passed_file.write_text(json.dumps({name: passed[name] for name in passed if name in entries}), encoding="utf-8")
    print(f"clang-tidy: {sum(read.values())} sources in {len(entries)} units, {len(entries) - len(todo)} unchanged since "
          f"they passed, {len(found)} with findings")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
