#!/usr/bin/env python3
"""clang-tidy over our own sources, in parallel, within a budget: tidy.py BUILD_DIR [--budget S] [--jobs N]

BUILD_DIR holds a compile_commands.json written for clang. A file that passed before is not looked at again until it, a
header of ours that it includes, its command or .clang-tidy changes. Files go in the order: changed since the branch left
main, then the rest, from a place that the commit chooses; when the budget is spent the remainder is named. So a machine
that keeps its build folder gets round to every file, and one that starts cold looks at another part with every commit.
Exit code 1 when clang-tidy finds anything.
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
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
ROOMS = ("common", "server", "client")
# Without the precompiled header: every check walks all that a file sees, and that header is most of it.
PRECOMPILED = re.compile(r" -Winvalid-pch| -Xclang -include(-pch)? -Xclang \S+| -fsanitize=\S+| -fno-sanitize-\S+")
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.MULTILINE)


def ours(build):
    """Root-relative path -> entry of the compilation database, for each of our sources."""
    entries = json.loads((build / "compile_commands.json").read_text(encoding="utf-8"))
    found = {}
    for entry in entries:
        path = pathlib.Path(entry["directory"], entry["file"]).resolve()
        if ROOT in path.parents and build not in path.parents:
            relative = path.relative_to(ROOT).as_posix()
            if relative.split("/")[0] in ROOMS and path.suffix == ".cpp":
                found[relative] = {**entry, "command": PRECOMPILED.sub("", entry["command"])}
    return found


def git(*arguments):
    """The words git prints; none where there is no git."""
    done = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=False)
    return done.stdout.split() if done.returncode == 0 else []


def in_order(paths):
    """Paths that differ from where this branch left main (or from the commit before), then the rest, rotated."""
    base = git("merge-base", "HEAD", "origin/main") or git("rev-parse", "HEAD~1")
    changed = set(git("diff", "--name-only", base[0])) if base else set()
    first, rest = sorted(changed.intersection(paths)), sorted(set(paths) - changed)
    start = int((git("rev-parse", "HEAD") or ["0"])[0], 16) % max(1, len(rest))
    return first + rest[start:] + rest[:start]


def closure(path, seen):
    """The file and every header of ours it includes, directly or not."""
    if path in seen or not (ROOT / path).is_file():
        return seen
    seen.add(path)
    for include in INCLUDE.findall((ROOT / path).read_text(encoding="utf-8")):
        closure(include, seen)
    return seen


def digest(path, command):
    summary = hashlib.sha256(command.encode())
    for part in [".clang-tidy", *sorted(closure(path, set()))]:
        summary.update(part.encode() + b"\0" + (ROOT / part).read_bytes())
    return summary.hexdigest()


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("build", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--budget", type=float, default=300, metavar="S", help="start no file after so many seconds")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    args = parser.parse_args()

    passed_file = args.build / "clang-tidy-passed.json"
    try:
        passed = json.loads(passed_file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        passed = {}
    commands = ours(args.build)
    database = args.build / "clang-tidy"
    database.mkdir(exist_ok=True)
    (database / "compile_commands.json").write_text(json.dumps(list(commands.values())), encoding="utf-8")
    if not commands:
        sys.exit(f"{args.build}/compile_commands.json names no source of ours")
    digests = {path: digest(path, entry["command"]) for path, entry in commands.items()}
    todo = in_order([path for path in commands if passed.get(path) != digests[path]])
    deadline = time.monotonic() + args.budget
    tidy = ["clang-tidy", "--quiet", "-p", str(database)]

    def run(path):
        if time.monotonic() > deadline:
            return path, None
        return path, subprocess.run([*tidy, str(ROOT / path)], capture_output=True, text=True, check=False)

    found, left = [], []
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        for path, done in pool.map(run, todo):
            if done is None:
                left.append(path)
            elif done.returncode == 0:
                passed[path] = digests[path]
            else:
                found.append(path)
                print(done.stdout + re.sub(r"^\d+ warnings?.*\n|^Suppressed.*\n|^Use -header.*\n", "", done.stderr,
                                           flags=re.MULTILINE), flush=True)
    passed_file.write_text(json.dumps({path: passed[path] for path in passed if path in commands}), encoding="utf-8")
    print(f"clang-tidy: {len(commands)} files, {len(commands) - len(todo)} unchanged since they passed, "
          f"{len(todo) - len(found) - len(left)} passed, {len(found)} with findings, {len(left)} not reached")
    if left:
        print(f"clang-tidy: NOT REACHED in {args.budget:.0f} s: {' '.join(left)}")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
