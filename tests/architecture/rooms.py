"""The arrows between rooms, as data: which room may include which, and where each library may appear.

This is section "The house" of the README in a form a machine can hold the tree to. A room is a folder; a file belongs to
the longest room its path starts with. A wanted arrow that is missing here is a design question first: change the arrow
and the README together.
"""

COMMON = ["common"]
SLAM = ["server/slam", *COMMON]
# The two bounded channels of plain values between the doors and the rooms: each header is a room of its own.
CHANNELS = ["server/inbound.h", "server/outbound.h"]

# Room -> rooms it may include besides itself. `common` does not stand for `common/wire`.
MAY_INCLUDE = {
    "idl": [],
    "common": [],
    "common/wire": COMMON,
    # The pure library.
    "server/slam": COMMON,
    "server/inbound.h": COMMON,
    "server/outbound.h": COMMON,
    # Files that options name, read before any estimator is made.
    "server/setup": SLAM,
    # Rooms of the server, in the order a scan walks: estimators, the map they feed, work on it, questions about all.
    "server/offline": [*SLAM, "server/setup"],
    "server/calibrate": [*SLAM, "server/offline"],
    "server/ops": [*SLAM, *CHANNELS],
    "server/robots": [*SLAM, *CHANNELS, "server/ops"],
    "server/maps": [*SLAM, *CHANNELS, "server/ops", "server/robots"],
    "server/jobs": [*SLAM, *CHANNELS, "server/ops", "server/robots", "server/maps"],
    "server/queries": [*SLAM, *CHANNELS, "server/ops", "server/robots", "server/maps", "server/jobs"],
    # The doors: plain values in and out, nothing of the rooms between them.
    "server/ingress": [*SLAM, *CHANNELS, "common/wire", "server/ops"],
    "server/egress": [*SLAM, *CHANNELS, "common/wire", "server/ops"],
    # server.h/.cpp and the programs know every room.
    "server": [*SLAM, *CHANNELS, "common/wire", "server/ops", "server/maps", "server/robots", "server/jobs",
               "server/queries", "server/ingress", "server/egress", "server/setup"],
    "client/lib": [*COMMON, "common/wire"],
    "client/sim": COMMON,
    "client/web": [*COMMON, "client/lib"],
    "client/cli": [*COMMON, "common/wire", "client/lib", "client/sim"],
    # Tests may look into everything.
    "tests": [*CHANNELS, "common", "common/wire", "server/slam", "server/ops", "server/maps", "server/robots",
              "server/jobs", "server/queries", "server/ingress", "server/egress", "server", "server/offline",
              "server/calibrate", "server/setup", "client/lib", "client/sim", "client/web", "client/cli"],
}

# The offline programs prove that slam stands alone: single files with less than their room may.
FILE_MAY_INCLUDE = {
    "server/offline.cpp": [*SLAM, "server/offline"],
    "server/calibrate.cpp": [*SLAM, "server/calibrate"],
}

# Library -> (how its headers begin, places that may include them, only in .cpp files?). A place is a folder, a file, or
# `folder/*` for the files directly in a folder. Tests may include every library.
LIBRARIES = {
    "DDS": (("fastdds/", "fastrtps/", "fastcdr/", "dds/", "ddsc/"), ("common/wire",), False),
    "OpenCV": (("opencv2/",), ("common/map", "server/slam", "server/maps", "client/cli"), True),
    "Ceres": (("ceres/",), ("server/slam",), True),
    "Protobuf": (("google/protobuf/",), ("server/maps/store",), False),
    "yaml-cpp": (("yaml-cpp/",), ("common/options", "common/map", "client/sim"), True),
    "spdlog": (("spdlog/", "fmt/"), ("server/*", "server/ingress", "server/egress", "server/robots", "server/maps",
                                     "server/jobs", "server/ops", "client"), False),
    "Asio": (("asio/", "asio.hpp", "boost/asio"), ("server/*", "server/robots", "server/maps", "server/jobs", "server/ops",
                                                   "client"), False),
    "CLI11": (("CLI/",), ("server/*", "server/offline", "server/calibrate", "client/cli", "client/web"), False),
    "JSON": (("nlohmann/",), ("server/*", "server/ops", "client/cli", "client/web"), False),
    "systemd": (("systemd/",), ("server/*", "server/ops"), True),
    "Eigen": (("Eigen/", "unsupported/Eigen/"), ("common", "server", "client"), False),
}

# Generated code (a quoted include that is no file of the tree) may be included here.
GENERATED_CODE = ("common/wire", "server/maps/store")

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
READS_ENVIRONMENT = ("common/wire/wire_arguments.cpp", "server/offline.cpp", "server/calibrate.cpp", "client/cli", "client/web",
                     "tests")

# Names that say nothing: whole words of a file name, whole file names, and ends of type names.
EMPTY_WORDS = {"util", "utils", "misc", "helper", "helpers", "manager", "stuff", "common"}
EMPTY_STEMS = {"base", "impl", "data", "process", "types", "defs"}
EMPTY_TYPES = r"\b(?:class|struct)\s+(?:\[\[\w+\]\]\s*)?(\w*(?:Manager|Helper|Helpers|Utils|Util))\b"

MOST_LINES = 400
