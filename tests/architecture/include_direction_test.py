#!/usr/bin/env python3
"""include_direction.py on small trees: one per rule, broken and kept. A rule nobody can break is no rule."""
import unittest

import rooms
from include_direction import Tree, check, check_plan

HEADER = "#pragma once\n"


def wrongs(files):
    """What is reported about a tree whose bodies are all listed in its root build file."""
    bodies = "\n".join(path for path in files if path.endswith((".cpp", ".c")))
    return check(Tree({"CMakeLists.txt": f"add_library(all {bodies})", **files}))


class Breaks(unittest.TestCase):
    def assert_wrong(self, path, text, expected, **others):
        files = {path: text}
        files.update({"common/status.h": HEADER, "common/wire/bus.h": HEADER, "server/slam/mapper.h": HEADER,
                      "server/robots/roster.h": HEADER, "server/maps/tiles.h": HEADER, "server/ingress/door.h": HEADER,
                      "server/egress/door.h": HEADER, "server/server.h": HEADER, "client/lib/robot_client.h": HEADER,
                      "client/sim/world.h": HEADER, "tests/common/fake.h": HEADER, **others})
        files[path] = text
        found = wrongs(files)
        self.assertEqual(len(found), 1, found)
        self.assertTrue(found[0].startswith(path), found)
        self.assertIn(expected, found[0])

    def test_rooms_of_slam_link_what_they_may_include(self):
        def build_file(change):
            lists = {room: list(others) for room, others in rooms.SLAM_ROOMS.items()}
            change(lists)
            return "\n".join(f"slam_room(NAME {room}{' ROOMS ' + ' '.join(links) if links else ''} SOURCES\n  x)"
                             for room, links in lists.items())
        for change in (lambda lists: lists["tracking"].append("voting"), lambda lists: lists["tracking"].pop(),
                       lambda lists: lists.pop("voting")):
            found = wrongs({"server/slam/CMakeLists.txt": build_file(change)})
            self.assertEqual(len(found), 1, found)
            self.assertIn("SLAM_ROOMS", found[0])
        self.assertEqual(wrongs({"server/slam/CMakeLists.txt": build_file(lambda lists: None)}), [])

    def test_precompiled_headers_hide_no_missing_include(self):
        for text, header in (("std::vector<int> a;", "vector"), ("auto b = std::max(1, 2);", "algorithm"),
                             ("Eigen::Vector2d c;", "Eigen/"), ("auto d = std::move(e);", "utility")):
            self.assert_wrong("common/sensor/scan.cpp", text, f"needs <{header}>")
            include = "Eigen/Core" if header == "Eigen/" else header
            self.assertEqual(wrongs({"common/sensor/scan.cpp": f"#include <{include}>\n{text}"}), [])
            self.assertEqual(wrongs({"common/sensor/scan.cpp": f'#include "common/status.h"\n{text}',
                                     "common/status.h": f"{HEADER}#include <{include}>\n"}), [])
        self.assertEqual(wrongs({"common/sensor/scan.cpp": "// std::vector"}), [])

    def test_arrows_between_rooms(self):
        for path, target in (("common/sensor/scan.h", "server/slam/mapper.h"),
                             ("common/sensor/scan.h", "common/wire/bus.h"),
                             ("common/wire/topic.h", "server/robots/roster.h"),
                             ("server/slam/grid/cells.h", "common/wire/bus.h"),
                             ("server/slam/grid/cells.h", "server/maps/tiles.h"),
                             ("server/maps/tiles.h", "server/robots/roster.h"),
                             ("server/robots/queue.h", "common/wire/bus.h"),
                             ("server/robots/queue.h", "server/server.h"),
                             ("server/outbound.h", "server/robots/roster.h"),
                             ("server/ingress/scans.h", "server/robots/roster.h"),
                             ("server/ingress/scans.h", "server/egress/door.h"),
                             ("server/queries/pose.h", "common/wire/bus.h"),
                             ("server/queries/pose.h", "server/server.h"),
                             ("client/lib/map_client.h", "server/slam/mapper.h"),
                             ("client/cli/replay.h", "server/server.h"),
                             ("client/sim/laser.h", "common/wire/bus.h"),
                             ("client/sim/laser.h", "client/lib/robot_client.h"),
                             ("server/server_options.h", "client/lib/robot_client.h")):
            with self.subTest(path=path, target=target):
                self.assert_wrong(path, f'{HEADER}#include "{target}"\n', "may not include")

    def test_the_tools_know_slam_alone(self):
        for target in ("server/robots/roster.h", "server/server.h"):
            self.assert_wrong("server/tools/offline/main.cpp", f'#include "{target}"\n', "may not include")

    def test_a_file_in_a_room_that_is_planned_only(self):
        for room in rooms.PLANNED:
            self.assert_wrong(f"{room}/thing.h", f'{HEADER}#include "common/status.h"\n', "planned room")

    def test_only_tests_include_tests(self):
        self.assert_wrong("common/sensor/scan.cpp", '#include "tests/common/fake.h"\n', "may not include tests")

    def test_libraries_in_the_wrong_room(self):
        for path, target in (("server/ingress/scans.cpp", "fastdds/dds/domain/DomainParticipant.hpp"),
                             ("client/lib/robot_client.cpp", "fastcdr/Cdr.h"),
                             ("server/robots/queue.cpp", "opencv2/core.hpp"),
                             ("common/geometry/lines.cpp", "ceres/ceres.h"),
                             ("server/slam/mapper.cpp", "google/protobuf/message.h"),
                             ("server/slam/mapper.cpp", "spdlog/spdlog.h"),
                             ("common/sensor/log_reader.cpp", "fmt/format.h"),
                             ("server/queries/pose.cpp", "asio/post.hpp"),
                             ("server/slam/mapper.cpp", "yaml-cpp/yaml.h"),
                             ("server/robots/queue.cpp", "nlohmann/json.hpp")):
            with self.subTest(path=path, target=target):
                self.assert_wrong(path, f"#include <{target}>\n", "does not belong here")

    def test_heavy_libraries_stay_out_of_headers(self):
        self.assert_wrong("common/map/field.h", f"{HEADER}#include <opencv2/core.hpp>\n", "not in a header")
        self.assert_wrong("server/slam/smoothing/graph.h", f"{HEADER}#include <ceres/ceres.h>\n", "not in a header")

    def test_generated_code_stays_at_the_door(self):
        self.assert_wrong("server/robots/queue.cpp", '#include "cairnPubSubTypes.h"\n', "generated code")

    def test_includes_start_at_the_root(self):
        self.assert_wrong("server/maps/tiles.cpp", '#include "tiles.h"\n', "no file of the tree")

    def test_impure_headers_in_slam_and_geometry(self):
        for path in ("server/slam/mapper.cpp", "common/geometry/pose2.cpp"):
            for header in sorted(rooms.IMPURE_HEADERS):
                with self.subTest(path=path, header=header):
                    self.assert_wrong(path, f"#include <{header}>\n", "no thread, clock or I/O")

    def test_impure_words_in_slam(self):
        for word in ("std::thread t;", "std::mutex m;", "std::chrono::steady_clock::now();", "std::cerr << 1;", "rand();",
                     "std::random_device d;", 'printf("x");', "thread_local int n;"):
            with self.subTest(word=word):
                self.assert_wrong("server/slam/mapper.cpp", f"void F() {{ {word} }}\n", "no thread, clock, I/O or log")

    def test_the_environment_is_read_at_the_start_only(self):
        self.assert_wrong("server/robots/queue.cpp", 'auto* x = std::getenv("X");\n', "environment")

    def test_a_header_without_pragma_once(self):
        self.assert_wrong("common/map/tile.h", "int x;\n", "#pragma once")
        self.assert_wrong("common/map/tile.h", "// #pragma once\nint x;\n", "#pragma once")

    def test_names_that_say_nothing(self):
        for path in ("common/map/utils.h", "server/maps/tile_helper.h", "server/robots/session_manager.h",
                     "server/jobs/misc/worker.h", "server/maps/data.h"):
            with self.subTest(path=path):
                self.assert_wrong(path, HEADER, "says nothing")
        self.assert_wrong("server/maps/tile.h", f"{HEADER}class TileManager {{}};\n", "TileManager")
        self.assert_wrong("server/maps/tile.h", f"{HEADER}struct [[nodiscard]] MapHelper {{}};\n", "MapHelper")

    def test_files_of_no_room_and_of_other_endings(self):
        self.assert_wrong("src/mapper.h", HEADER, "no room")
        self.assert_wrong("server/maps/tile.hpp", HEADER, ".hpp")

    def test_a_file_that_is_too_long(self):
        self.assert_wrong("server/maps/tile.h", HEADER + "\n" * rooms.MOST_LINES, "one noun")

    def test_the_line_is_named(self):
        text = '/* a\nlong\ncomment */\n#include "common/wire/bus.h"\n'
        files = {"server/slam/mapper.cpp": text, "common/wire/bus.h": HEADER}
        self.assertTrue(wrongs(files)[0].startswith("server/slam/mapper.cpp:4: "))


class Plan(unittest.TestCase):
    def test_a_room_without_a_file_is_reported_unless_it_is_planned(self):
        files = {f"{room}/a.h" if "." not in room else room: HEADER for room in rooms.MAY_INCLUDE}
        self.assertEqual(list(check_plan(Tree(files))), [])
        del files["server/jobs/a.h"]
        self.assertEqual(len(list(check_plan(Tree(files)))), 1)


class BuildLists(unittest.TestCase):
    def test_a_body_that_nothing_compiles(self):
        files = {"common/CMakeLists.txt": "add_library(c a.cpp # b.cpp\n)", "common/a.cpp": "", "common/b.cpp": ""}
        self.assertEqual(check(Tree(files)), ["common/b.cpp: is in no CMakeLists.txt, so nothing compiles it"])

    def test_bodies_are_found_from_every_folder_above(self):
        files = {"common/CMakeLists.txt": "add_library(c map/a.cpp)", "common/map/a.cpp": "",
                 "tests/CMakeLists.txt": "cairn_test(SOURCES ${CMAKE_SOURCE_DIR}/common/map/b.cpp)", "common/map/b.cpp": ""}
        self.assertEqual(check(Tree(files)), [])

    def test_globbing(self):
        self.assertIn("not globbed", check(Tree({"common/CMakeLists.txt": "file(GLOB_RECURSE x *.cpp)"}))[0])


class Keeps(unittest.TestCase):
    def test_the_arrows_of_the_house(self):
        self.assertEqual(wrongs({
            "common/status.h": HEADER,
            "common/version.h.in": HEADER,
            "common/wire/bus.h": f'{HEADER}#include <fastdds/dds/topic/Topic.hpp>\n#include "common/status.h"\n',
            "common/wire/bus.cpp": '#include "common/wire/bus.h"\n#include "cairnPubSubTypes.h"\n',
            "server/slam/mapper.h": f'{HEADER}#include <Eigen/Core>\n#include "common/status.h"\n',
            "server/slam/mapper.cpp": '#include <ceres/ceres.h>\n#include "server/slam/mapper.h"\n',
            "server/robots/queue.h": f'{HEADER}#include <mutex>\n#include "server/slam/mapper.h"\n',
            "server/inbound.h": f'{HEADER}#include "common/status.h"\n',
            "server/ingress/door.h": f'{HEADER}#include "common/wire/bus.h"\n#include "server/inbound.h"\n',
            "client/sim/worlds.cpp": '#include "client/sim/worlds.inc"\n',
            "server/server.cpp": '#include "server/ingress/door.h"\n#include "server/robots/queue.h"\n#include "common/version.h"\n',
            "server/tools/offline/main.cpp": '#include "server/slam/mapper.h"\n',
            "client/cli/main.cpp": '#include <CLI/CLI.hpp>\n#include "common/wire/bus.h"\nauto* d = std::getenv("D");\n',
            "tests/server/slam/mapper_test.cpp": '#include <ceres/ceres.h>\n#include "server/slam/mapper.h"\n',
        }), [])

    def test_comments_and_texts_are_not_code(self):
        self.assertEqual(wrongs({"server/slam/mapper.cpp":
                                 '// std::mutex, class XManager, getenv\n/* #include <thread>\n*/\n'
                                 'const char* kText = "std::thread rand()";\n'}), [])


if __name__ == "__main__":
    unittest.main()
