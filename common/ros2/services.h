// The services of ROS 2 that the server answers, as plain values: what is asked, what is answered, and the codes of
// results as ROS defines them (nav_msgs/srv, slam_toolbox/srv). Texts have been checked for their length only
// (message_checks.h) when a request arrives.
#pragma once

#include <cstdint>
#include <string>

#include "common/ros2/messages.h"

namespace cairn::ros2 {

struct GetMap {
  struct Request {};
  struct Response {
    Grid map;  // Without cells where there is no map.
  };
};

struct LoadMap {
  static constexpr std::uint8_t kSuccess = 0, kMapDoesNotExist = 1, kInvalidMapData = 2, kInvalidMapMetadata = 3,
                                kUndefinedFailure = 255;
  struct Request {
    std::string map_url;
  };
  struct Response {
    Grid map;  // Valid only with kSuccess.
    std::uint8_t result = kUndefinedFailure;
  };
};

struct SaveMap {
  static constexpr std::uint8_t kSuccess = 0, kNoMapReceived = 1, kUndefinedFailure = 255;
  struct Request {
    std::string name;
  };
  struct Response {
    std::uint8_t result = kUndefinedFailure;
  };
};

struct SerializePoseGraph {
  static constexpr std::uint8_t kSuccess = 0, kFailedToWriteFile = 255;
  struct Request {
    std::string filename;
  };
  struct Response {
    std::uint8_t result = kFailedToWriteFile;
  };
};

// Changes between taking new measurements into the map and not.
struct Pause {
  struct Request {};
  struct Response {
    bool status = false;  // Whether it was done.
  };
};

struct Reset {
  // ROS defines only kSuccess.
  static constexpr std::uint8_t kSuccess = 0, kFailure = 255;
  struct Request {
    bool pause_new_measurements = false;
  };
  struct Response {
    std::uint8_t result = kFailure;
  };
};

}  // namespace cairn::ros2
