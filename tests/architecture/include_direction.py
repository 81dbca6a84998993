#!/usr/bin/env python3
"""Reads every source file of the tree and reports what breaks the house's rules (rooms.py): include_direction.py [ROOT]

It looks at text, not at a build, so it runs in a second and before anything compiles. Exit code 1 when it reports.
"""
import pathlib
import re
import subprocess
import sys

import rooms

HEADERS, BODIES = {".h"}, {".cpp", ".c"}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(?:"([^"]+)"|<([^>]+)>)', re.MULTILINE)
COMMENT_OR_TEXT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)


def inside(path, places):
    """Whether a path lies in one of the places: `folder`, `file`, or `folder/*` for files directly in it."""
    for place in places:
        if place.endswith("/*"):
            if str(pathlib.PurePosixPath(path).parent) == place[:-2]:
                return True
        elif path == place or path.startswith(place + "/"):
            return True
    return False


def room_of(path):
    """The longest room, built or planned, that holds the path; None outside the house."""
    known = (*rooms.MAY_INCLUDE, *rooms.PLANNED)
    return max((room for room in known if inside(path, [room])), key=len, default=None)


def blank(pattern, text):
    """The text without what matches, line numbers kept."""
    return pattern.sub(lambda match: "\n" * match.group().count("\n"), text)


class Tree:
    """The source files of a tree, as root-relative paths with their text."""

    def __init__(self, files):
        self.files = files
        self.sources = {path: text for path, text in files.items() if pathlib.PurePosixPath(path).suffix in HEADERS | BODIES}

    @staticmethod
    def read(root):
        listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard"], capture_output=True,
                                text=True, check=False)
        if listed.returncode == 0:
            paths = listed.stdout.splitlines()
        else:  # A release archive has no git.
            paths = [path.relative_to(root).as_posix() for path in pathlib.Path(root).rglob("*")]
        wanted = {".h", ".cpp", ".c", ".txt", ".in", ".hpp", ".cc", ".hh", ".cxx"}
        files = {}
        for path in paths:
            full = pathlib.Path(root, path)
            if full.suffix in wanted and full.is_file() and not path.startswith(("build/", "demo-out/")):
                files[path] = full.read_text(encoding="utf-8", errors="replace")
        return Tree(files)


def check_include(tree, path, target, quoted):
    """Yields what is wrong with one include of one file."""
    in_tests = inside(path, ["tests"])
    is_ours = quoted and (target in tree.files or target + ".in" in tree.files)
    if is_ours:
        own = room_of(path)
        other = room_of(target)
        if other != own and other not in rooms.MAY_INCLUDE.get(own, []) and own not in rooms.PLANNED:
            yield f'{own or "the top"} may not include {other or "the top"} ("{target}")'
        return
    for library, (starts, places, bodies_only) in rooms.LIBRARIES.items():
        if target.startswith(starts):
            if in_tests:
                return
            if not inside(path, places):
                yield f"{library} does not belong here ({target})"
            elif bodies_only and pathlib.PurePosixPath(path).suffix in HEADERS:
                yield f"{library} belongs in .cpp files, not in a header ({target})"
            return
    if quoted and target.endswith(".inc") and room_of(target) == room_of(path):
        return  # Text of the room that its build file turns into an array.
    if target.endswith((".pb.h", "PubSubTypes.h")) or quoted:
        if not in_tests and not inside(path, rooms.GENERATED_CODE):
            yield f'"{target}" is no file of the tree (paths start at the root), and generated code does not belong here'


def check_source(tree, path):
    """Yields (line, what is wrong) for one source file."""
    text = tree.sources[path]
    code = blank(COMMENT, text)
    bare = blank(COMMENT_OR_TEXT, text)

    # Blanking keeps lines but not offsets: count in the text that was searched.
    def found(pattern, searched):
        for match in re.finditer(pattern, searched):
            yield searched.count("\n", 0, match.start()) + 1, match

    pure = inside(path, rooms.PURE)
    for line, match in found(INCLUDE, code):
        target, quoted = match.group(1) or match.group(2), match.group(1) is not None
        for wrong in check_include(tree, path, target, quoted):
            yield line, wrong
        if pure and not quoted and target in rooms.IMPURE_HEADERS:
            yield line, f"{room_of(path)} has no thread, clock or I/O (<{target}>)"
    if pure:
        for word in rooms.IMPURE_WORDS:
            for line, match in found(word, bare):
                yield line, f"{room_of(path)} has no thread, clock, I/O or log ({match.group().strip()})"
    if not inside(path, rooms.READS_ENVIRONMENT):
        for line, _ in found(r"\b(secure_)?getenv\b", bare):
            yield line, "the environment is read where a program starts, and handed on as options"
    for line, match in found(rooms.EMPTY_TYPES, bare):
        yield line, f"a class is a thing, and {match.group(1)} names none"
    if pathlib.PurePosixPath(path).suffix in HEADERS and not re.search(r"^#pragma once$", code, re.MULTILINE):
        yield 1, "a header needs #pragma once"
    lines = text.count("\n")
    if lines > rooms.MOST_LINES:
        yield lines, f"{lines} lines; a file is one noun, of at most {rooms.MOST_LINES} lines"


def check_name(path):
    """Yields what is wrong with a path itself."""
    pure_path = pathlib.PurePosixPath(path)
    if pure_path.suffix in {".hpp", ".cc", ".hh", ".cxx"}:
        yield f"sources end in .h, .cpp or .c, not in {pure_path.suffix}"
    if pure_path.suffix not in HEADERS | BODIES:
        return
    if room_of(path) is None:
        yield "belongs to no room"
    if room_of(path) in rooms.PLANNED:
        yield f"{room_of(path)} is a planned room: who builds it moves it into MAY_INCLUDE (rooms.py)"
    if pure_path.stem in rooms.EMPTY_STEMS:
        yield f"the name '{pure_path.stem}' says nothing"
    for number, part in enumerate((*pure_path.parts[:-1], pure_path.stem)):
        if number == 0 or (part == "common" and pure_path.parts[0] == "tests"):
            continue  # The room `common`, and its mirror in tests.
        for word in sorted(rooms.EMPTY_WORDS.intersection(part.split("_"))):
            yield f"the name '{word}' says nothing"


def headers_of(tree, path, known):
    """The headers of libraries that a file includes, itself or through files of the tree."""
    if path not in known:
        known[path] = headers = set()
        for match in INCLUDE.finditer(blank(COMMENT, tree.sources.get(path, ""))):
            if match.group(1):
                headers |= headers_of(tree, match.group(1), known)
            else:
                headers.add("Eigen/" if match.group(2).startswith("Eigen/") else match.group(2))
                headers.update({"utility"} if match.group(2) in rooms.BRINGS_UTILITY else ())
    return known[path]


def check_used_headers(tree):
    """Yields (path, what is wrong) where a source uses what only the precompiled headers declare for it."""
    known = {}
    for path, text in tree.sources.items():
        if inside(path, ["tests"]) or pathlib.PurePosixPath(path).suffix == ".c":
            continue
        bare = blank(COMMENT_OR_TEXT, text)
        for header, names in rooms.HEADER_OF.items():
            if header in rooms.IMPURE_HEADERS and inside(path, rooms.PURE):
                continue  # It may neither use nor include this.
            used = re.search(names, bare)
            if used and header not in headers_of(tree, path, known):
                line = bare.count("\n", 0, used.start()) + 1
                yield f"{path}:{line}", f"{used.group()} needs <{header}>, which nothing here includes"


def check_build_lists(tree):
    """Yields (path, what is wrong) about source files that no build file lists."""
    listed = set()
    for path, text in tree.files.items():
        pure_path = pathlib.PurePosixPath(path)
        if pure_path.name != "CMakeLists.txt":
            continue
        code = re.sub(r"#[^\n]*", "", text)
        if re.search(r"\bfile\s*\(\s*GLOB", code):
            yield path, "sources are listed by hand, not globbed"
        for word in re.findall(r"[\w./+-]+\.(?:cpp|c)\b", code):
            listed.add((pure_path.parent / word).as_posix())
            listed.add(word)  # From the root, after ${CMAKE_SOURCE_DIR}/.
            listed.add(word.lstrip("/"))
    for path in tree.sources:
        if pathlib.PurePosixPath(path).suffix in BODIES and path not in listed:
            yield path, "is in no CMakeLists.txt, so nothing compiles it"


def check_slam_links(tree):
    """Yields what is wrong where the rooms of slam do not link what SLAM_ROOMS lets them include."""
    path = "server/slam/CMakeLists.txt"
    linked = {name: links.split() for name, links in re.findall(r"^slam_room\(NAME (\w+)(?: ROOMS ([\w ]+))? SOURCES",
                                                               tree.files.get(path, ""), re.MULTILINE)}
    if not linked:
        return
    for room, may_include in rooms.SLAM_ROOMS.items():
        if sorted(linked.get(room, [])) != sorted(may_include):
            yield path, f"{room} links {linked.get(room)}, and SLAM_ROOMS lets it include {may_include}"


def check_plan(tree):
    """Yields which rooms of the list do not exist."""
    for room in rooms.MAY_INCLUDE:
        if not any(inside(path, [room]) for path in tree.files):
            yield f"the room {room} holds no file: rooms that are not built yet belong in PLANNED"


def check(tree):
    """All that breaks a rule, as `path:line: what`."""
    wrong = []
    for path in tree.files:
        wrong += [f"{path}: {what}" for what in check_name(path)]
    for path in tree.sources:
        wrong += [f"{path}:{line}: {what}" for line, what in check_source(tree, path)]
    wrong += [f"{path}: {what}"
              for path, what in (*check_used_headers(tree), *check_build_lists(tree), *check_slam_links(tree))]
    return sorted(wrong)


def main():
    root = sys.argv[1] if len(sys.argv) > 1 else str(pathlib.Path(__file__).resolve().parents[2])
    tree = Tree.read(root)
    if not tree.sources:
        sys.exit(f"no source file below {root}")
    wrong = check(tree) + [f"tests/architecture/rooms.py: {what}" for what in check_plan(tree)]
    print("\n".join(wrong or [f"{len(tree.sources)} source files keep to the house's rules"]))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
