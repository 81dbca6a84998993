#!/usr/bin/env python3
"""Counts what a run of ctest did: count_tests.py CTEST_JUNIT_XML GTEST_FOLDER

A program of GoogleTest is one test of ctest and leaves a file NAME.xml in GTEST_FOLDER with all its tests, which are counted
instead. One that left none (it crashed, or there was no time) counts as one. Prints how many tests there were, how many
failed, how many were skipped, and then a line for each skipped one: its name and why.
"""
import pathlib
import re
import sys
import xml.etree.ElementTree


def why_skipped(text):
    found = re.search("SKIPPED: (.*)", text or "")
    return found.group(1).strip() if found else ""


def tests_of_program(path):
    """(name, failed, skipped, why) of each test that the program ran."""
    for case in xml.etree.ElementTree.parse(path).getroot().iter("testcase"):
        if case.get("status") != "run":
            continue  # Left out by a filter, or disabled.
        skipped = case.get("result") == "skipped"
        name = f"{path.stem}.{case.get('classname')}.{case.get('name')}"
        yield name, case.find("failure") is not None, skipped, why_skipped("".join(case.itertext()) + "\n" + "\n".join(
            child.get("message", "") for child in case)) if skipped else ""


def tests_of_ctest(junit, programs):
    """The same of the whole run."""
    for case in xml.etree.ElementTree.parse(junit).getroot().iter("testcase"):
        status = case.get("status")
        failed = status == "fail"
        own = programs / f"{case.get('name')}.xml"
        if own.is_file():
            inside = list(tests_of_program(own))
            yield from inside
            # Its exit code says failed although no test did: a sanitizer's report at the end, for example.
            if failed and not any(test[1] for test in inside):
                yield case.get("name"), True, False, ""
        else:
            skipped = status in ("notrun", "disabled")
            yield case.get("name"), failed, skipped, why_skipped(case.findtext("system-out")) if skipped else ""


def main():
    junit, programs = map(pathlib.Path, sys.argv[1:])
    tests = list(tests_of_ctest(junit, programs))
    print(len(tests), sum(test[1] for test in tests), sum(test[2] for test in tests), sep="\n")
    for name, _, skipped, why in tests:
        if skipped:
            print(f"{name}: {why}" if why else name)


if __name__ == "__main__":
    main()
