"""The arrows between rooms, as data: which room may include which, and where each library may appear.

This is section "The house" of the README in a form a machine can hold the tree to. A room is a folder; a file belongs to
the longest room its path starts with. A wanted arrow that is missing here is a design question first: change the arrow
and the README together.
"""

COMMON = ["common"]

# The rooms of the pure library, from the ground up: a room may include `common`, the file `parallel_for.h`, the room
# `state` and the rooms named here, nothing else; so no arrow runs back up. The second part holds the methods of the theses that the default
# configuration does not use.
SLAM_ROOMS = {
    "state": [],  # How a state is written as bytes and read.
    "random": [],  # Draws and resampling.
    "scan": [],  # What a scan is: points, surfaces, tilt, its odometry.
    "features": ["scan"],  # Lines and corners of a scan.
    "motion": [],  # What a step is, and its noise.
    "graph": [],  # Relations between keyframes, and the path that fits them best.
    "grid": ["scan"],  # Cells and rays.
    "trail": ["graph", "motion", "scan"],  # Keyframes and the path through them.
    "matching": ["features", "scan"],  # One scan against another: answers, point-to-line.
    "voting": ["matching", "features"],  # The default's matcher.
    "landmarks": ["features"],  # Which features become landmarks, and their estimates.
    "filters": ["landmarks", "motion", "trail", "features"],  # What every filter is to the mapper.
    "fastslam": ["filters", "landmarks", "motion", "random", "trail"],
    "loops": ["filters", "trail", "matching", "grid", "scan"],  # Old places seen again; contradictions.
    "tracking": ["matching", "features", "motion", "trail", "scan"],  # Scan against the last keyframes.
    "recovery": ["loops", "tracking", "matching", "trail", "motion", "scan"],  # A robot that was not watched.
    "known_grid": ["recovery", "loops", "tracking", "matching", "motion", "grid", "trail", "scan"],  # A map of others.
    "drawing": ["trail", "grid"],  # The map of the robot along its path.
    "smoothing": ["trail", "grid", "scan"],  # Paths and maps after the fact.
    "site": ["recovery", "loops", "smoothing", "graph", "matching", "trail", "motion", "scan"],  # Several sessions as one graph.

    "motion_models": ["motion", "random"],  # Learnt or sampled models of a step.
    "calibration": ["matching", "motion_models", "random", "scan"],  # How models, wheels and lidars are learnt.
    "matchers": ["matching", "features", "scan"],
    "landmark_variants": ["landmarks"],  # Other models of a landmark.
    "ekf": ["filters", "landmark_variants", "landmarks", "motion"],
    "reckoning": ["filters", "landmarks", "motion", "trail"],  # Filters of one path, dead reckoned.
    "dpslam": ["filters", "motion", "motion_models", "random", "trail", "scan"],
    "localisation": ["reckoning", "filters", "matchers", "motion", "trail", "features"],
}
PARALLEL = "server/slam/parallel_for.h"
SLAM = ["server/slam", PARALLEL, *(f"server/slam/{room}" for room in SLAM_ROOMS), *COMMON]
# The two bounded channels of plain values between the doors and the rooms: each header is a room of its own.
CHANNELS = ["server/inbound.h", "server/outbound.h"]

# Room -> rooms it may include besides itself. `common` does not stand for `common/wire`.
MAY_INCLUDE = {
    "idl": [],
    "common": [],
    "common/wire": COMMON,
    # Recordings, and bags of ROS 2: for programs that read and write logs, not for the server.
    "common/bag": COMMON,
    # The messages of ROS 2 on the wire: the server speaks them, and a recorder listens.
    "common/wire/ros2": [*COMMON, "common/wire"],
    # The pure library: its rooms, and at the top the recipe and the choice of methods, which may use them all.
    PARALLEL: [],
    **{f"server/slam/{room}": [PARALLEL, "server/slam/state", *(f"server/slam/{below}" for below in rooms), *COMMON]
       for room, rooms in SLAM_ROOMS.items()},
    "server/slam": SLAM,
    "server/inbound.h": COMMON,
    "server/outbound.h": COMMON,
    # The one file that options name: read for the server and for the tools, before any estimator is made.
    "server/known_map.h": SLAM,
    "server/known_map.cpp": [*SLAM, "server/known_map.h"],
    # Programs without a server: they prove that slam stands alone.
    "server/tools": [*SLAM, "common/bag", "server/known_map.h"],
    # Durable state: what outlives the process, as records in a database. It knows none of the rooms that use it.
    "server/store": COMMON,
    # Rooms of the server, each of which may use those before it: the joint map of a site, the robots that draw it (a
    # session tells its site what changed), work on both, questions about all.
    "server/ops": [*SLAM, *CHANNELS],
    "server/maps": [*SLAM, *CHANNELS, "server/store", "server/ops"],
    "server/robots": [*SLAM, *CHANNELS, "server/store", "server/ops", "server/maps"],
    "server/jobs": [*SLAM, *CHANNELS, "server/store", "server/ops", "server/maps", "server/robots"],
    "server/queries": [*SLAM, *CHANNELS, "server/store", "server/ops", "server/maps", "server/robots", "server/jobs"],
    # The doors: plain values in and out, nothing of the rooms between them.
    "server/ingress": [*SLAM, *CHANNELS, "common/wire", "server/ops"],
    "server/egress": [*SLAM, *CHANNELS, "common/wire", "server/ops"],
    # A second kind of door beside these two: ROS 2 messages to and from the same two channels, checked by the same
    # admission.
    "server/ros2": [*COMMON, *CHANNELS, "common/wire", "common/wire/ros2", "server/ops", "server/ingress"],
    # server.h/.cpp and the programs know every room.
    "server": [*SLAM, *CHANNELS, "common/wire", "server/store", "server/ops", "server/maps", "server/robots", "server/jobs",
               "server/queries", "server/ingress", "server/egress", "server/ros2", "server/known_map.h"],
    "client/lib": [*COMMON, "common/wire"],
    "client/sim": COMMON,
    "client/cli": [*COMMON, "common/bag", "common/wire", "common/wire/ros2", "client/lib", "client/sim"],
    # The web page and what serves it: a client like any other.
    "client/web": [*COMMON, "common/wire", "client/lib"],
    # The commands on a stopped server's state and on saved sites: they read and write the store's records, and know
    # nothing else of the server.
    "client/cli/site_stored.cpp": [*COMMON, "client/cli", "client/lib", "server/store"],
    "client/cli/map_import.cpp": [*COMMON, "client/cli", "client/lib", "server/store"],
    # Tests may look into everything.
    "tests": [*CHANNELS, *SLAM, "common/bag", "common/wire", "server/store", "server/ops", "server/maps", "server/robots", "server/jobs",
              "server/queries", "server/ingress", "server/egress", "server/ros2", "common/wire/ros2", "server", "server/tools",
              "server/known_map.h",
              "client/lib", "client/sim", "client/cli", "client/web"],
}

# Rooms that are planned and hold no file yet: what comes next gets its place and its arrows before it is built. Room ->
# (rooms it may include, rooms that may include it). Who builds one moves both into MAY_INCLUDE; until then the checker
# reports every file in it.
PLANNED = {
}

# Library -> (how its headers begin, places that may include them, only in .cpp files?). A place is a folder, a file, or
# `folder/*` for the files directly in a folder. Tests may include every library.
LIBRARIES = {
    "DDS": (("fastdds/", "fastrtps/", "fastcdr/", "dds/", "ddsc/"), ("common/wire",), False),
    "OpenCV": (("opencv2/",), ("common/map", "client/cli"), True),
    "libpng": (("png.h",), ("common/map",), True),
    "Ceres": (("ceres/",), ("server/slam",), True),
    "Protobuf": (("google/protobuf/",), ("server/store", "common/bag"), False),
    "SQLite": (("SQLiteCpp/", "sqlite3.h"), ("server/store", "common/bag"), True),
    "zstd": (("zstd.h",), ("server/store", "common/bag"), True),
    "lz4": (("lz4frame.h", "lz4.h"), ("common/bag",), True),
    "zlib": (("zlib.h",), ("common/bag",), True),
    "yaml-cpp": (("yaml-cpp/",), ("common/options", "common/map", "common/bag", "client/sim"), True),
    "spdlog": (("spdlog/", "fmt/"), ("server/*", "server/ingress", "server/egress", "server/robots", "server/maps",
                                     "server/jobs", "server/queries", "server/ops", "server/ros2", "client"), False),
    "cpp-httplib": (("httplib.h",), ("common/http",), False),
    "Asio": (("asio/", "asio.hpp", "boost/asio"), ("server/*", "server/robots", "server/maps", "server/jobs", "server/ops",
                                                   "client"), False),
    "CLI11": (("CLI/",), ("server/*", "server/tools", "client/cli", "client/web"), False),
    "JSON": (("nlohmann/",), ("server/*", "server/ops", "server/tools", "client/cli", "client/web"), False),
    "systemd": (("systemd/",), ("server/*", "server/ops"), True),
    "Eigen": (("Eigen/", "unsupported/Eigen/"), ("common", "server", "client"), False),
}

# Generated code (a quoted include that is no file of the tree) may be included here.
GENERATED_CODE = ("common/wire", "server/store", "common/bag")

# No thread, clock, I/O or log: same input and seed, same bytes out. Files and streams of logs are common/sensor's trade.
PURE = ("server/slam", "common/geometry")
IMPURE_HEADERS = {"thread", "mutex", "shared_mutex", "condition_variable", "atomic", "future", "semaphore", "latch",
                  "barrier", "stop_token", "chrono", "ctime", "time.h", "iostream", "fstream", "cstdio", "stdio.h",
                  "filesystem", "syncstream", "pthread.h", "unistd.h"}
IMPURE_WORDS = (r"std::(this_thread|j?thread|mutex|async)\b", r"\b(system|steady|high_resolution)_clock\b",
                r"std::(cout|cerr|clog|cin)\b", r"\bstd::random_device\b", r"\b(s?rand|time|clock|printf|puts)\s*\(",
                r"\bthread_local\b")

# Settings come through options; the environment is read where a program starts, and in the one function that ranks
# CAIRN_DOMAIN among them.
READS_ENVIRONMENT = ("common/wire/wire_arguments.cpp", "server/state_directory.cpp", "server/tools/offline/main.cpp",
                     "server/tools/calibrate/main.cpp", "client/cli", "client/web",
                     "tests")

# Names that say nothing: whole words of a file name, whole file names, and ends of type names.
EMPTY_WORDS = {"util", "utils", "misc", "helper", "helpers", "manager", "stuff", "common"}
EMPTY_STEMS = {"base", "impl", "data", "process", "types", "defs"}
EMPTY_TYPES = r"\b(?:class|struct)\s+(?:\[\[\w+\]\]\s*)?(\w*(?:Manager|Helper|Helpers|Utils|Util))\b"

MOST_LINES = 400

# What the precompiled headers (common/precompiled.cmake) declare for everybody, and the header that a source must include
# for it, itself or through headers of the tree: without precompiled headers it has to compile as well.
HEADER_OF = {
    "Eigen/": r"\bEigen::",
    "algorithm": r"\bstd::(ranges::)?(all_of|any_of|none_of|find|find_if|count_if|copy|copy_if|transform|fill|sort|stable_sort|"
                 r"nth_element|lower_bound|upper_bound|min|max|minmax|clamp|min_element|max_element|remove_if|reverse|rotate|unique)\(",
    "array": r"\bstd::array\b",
    "chrono": r"\bstd::chrono::",
    "cmath": r"\bstd::(sqrt|hypot|cos|sin|tan|atan2|abs|floor|ceil|round|lround|exp|log|log1p|pow|isfinite|isnan|fmod|remainder)\(",
    "filesystem": r"\bstd::filesystem::",
    "functional": r"\bstd::(function|hash|less|greater)\b",
    "map": r"\bstd::(multi)?map\b",
    "memory": r"\bstd::(unique_ptr|shared_ptr|weak_ptr|make_unique|make_shared)\b",
    "optional": r"\bstd::(optional|nullopt|make_optional)\b",
    "set": r"\bstd::(multi)?set\b",
    "span": r"\bstd::span\b",
    "sstream": r"\bstd::[io]?stringstream\b",
    "string": r"\bstd::(string|to_string|getline|stoi|stod)\b",
    "string_view": r"\bstd::string_view\b",
    "thread": r"\bstd::(thread|this_thread|jthread)\b",
    "utility": r"\bstd::(pair|move|exchange|swap|forward|as_const)\b",
    "variant": r"\bstd::(variant|visit|get_if|monostate|holds_alternative)\b",
    "vector": r"\bstd::vector\b",
}
# Headers that bring <utility>, as the standard's text of them or every library has it.
BRINGS_UTILITY = {"algorithm", "chrono", "functional", "map", "memory", "optional", "unordered_map", "variant", "vector"}
