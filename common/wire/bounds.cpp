#include "common/wire/bounds.h"

#include <string>
#include <string_view>
#include <vector>

#include "common/map/map_edit.h"
#include "common/service/learned_value.h"
#include "common/service/names.h"
#include "common/service/pose_report.h"
#include "common/wire/limits.h"

namespace cairn::wire {
// Checks of nested values. They are in the namespace cairn::wire, not in an unnamed one, so that Bounds::Each
// finds all overloads.
static Result<void> CheckBounds(const v1::MapVersion& version);
static Result<void> CheckBounds(const v1::MapEdit& edit);
static Result<void> CheckBounds(const v1::TileContent& content);
static Result<void> CheckBounds(const v1::TileRecord& tile);
static Result<void> CheckBounds(const v1::Landmark& landmark);
static Result<void> CheckBounds(const v1::LearnedValue& learned);
static Result<void> CheckBounds(const v1::RobotStatus& robot);
static Result<void> CheckBounds(const v1::SavedSite& saved);
static Result<void> CheckBounds(const v1::Ros2DoorState& door);
static Result<void> CheckBounds(const v1::Ros2Topic& topic);
static Result<void> CheckBounds(const v1::Ros2Namespace& name_space);

namespace {

// Collects the first violation, so that each check below reads as a list of fields.
class Bounds {
 public:
  Bounds& AtMost(std::string_view field, std::size_t size, std::size_t limit) {
    if (size > limit) Refuse(field, std::to_string(size) + " elements, at most " + std::to_string(limit));
    return *this;
  }
  Bounds& Name(std::string_view field, const std::string& text) { return Characters(field, text, kMaxNameBytes); }
  Bounds& Text(std::string_view field, const std::string& text) { return Characters(field, text, kMaxTextBytes); }
  // A received enum may have any 32-bit value, not only those of the IDL.
  template <typename Enum>
  Bounds& Known(std::string_view field, Enum value, Enum last) {
    if (static_cast<std::uint32_t>(value) > static_cast<std::uint32_t>(last)) {
      Refuse(field, "unknown value " + std::to_string(static_cast<std::uint32_t>(value)));
    }
    return *this;
  }
  Bounds& Within(std::string_view field, std::int64_t value, std::int64_t low, std::int64_t high) {
    if (value < low || value > high) {
      Refuse(field, std::to_string(value) + " not in " + std::to_string(low) + ".." + std::to_string(high));
    }
    return *this;
  }
  template <typename Elements>
  Bounds& Each(std::string_view field, const Elements& elements, std::size_t limit) {
    AtMost(field, elements.size(), limit);
    if (!result_) return *this;
    for (const auto& element : elements) {
      if (const Result<void> inner = CheckBounds(element); !inner) {
        Refuse(field, inner.error().message);
        break;
      }
    }
    return *this;
  }
  Bounds& Texts(std::string_view field, const std::vector<std::string>& texts, std::size_t limit) {
    AtMost(field, texts.size(), limit);
    for (const std::string& text : texts) Text(field, text);
    return *this;
  }
  Bounds& Inside(std::string_view field, const Result<void>& inner) {
    if (!inner) Refuse(field, inner.error().message);
    return *this;
  }
  Bounds& Status(std::string_view field, const v1::Status& status) {
    Within(field, status.code(), 0, static_cast<int>(StatusCode::kDataLoss));
    return Text(field, status.message());
  }
  [[nodiscard]] const Result<void>& result() const { return result_; }

 private:
  // A string of the IDL has no zero inside. Fast CDR delivers one that has, and would send only what is before it.
  Bounds& Characters(std::string_view field, const std::string& text, std::size_t limit) {
    if (text.find('\0') != std::string::npos) Refuse(field, "has a zero byte inside");
    return AtMost(field, text.size(), limit);
  }
  void Refuse(std::string_view field, const std::string& why) {
    if (result_) result_ = Fail(StatusCode::kOutOfRange, std::string(field) + ": " + why);
  }
  Result<void> result_;
};

}  // namespace

static Result<void> CheckBounds(const v1::MapVersion& version) {
  return Bounds().Text("note", version.note()).result();
}

static Result<void> CheckBounds(const v1::MapEdit& edit) {
  return Bounds()
      .Known("kind", edit.kind(), v1::MAP_EDIT_ORIGIN)
      .AtMost("points", edit.points().size(), kMostEditPoints)
      .Text("note", edit.note())
      .result();
}

static Result<void> CheckBounds(const v1::TileContent& content) {
  return Bounds()
      .Known("encoding", content.encoding(), v1::TILE_PNG)
      .AtMost("bytes", content.bytes().size(), kMaxTileBytes)
      .result();
}

static Result<void> CheckBounds(const v1::TileRecord& tile) {
  return Bounds()
      .Within("level", tile.level(), 0, kMaxTileLevel)
      .Inside("content", CheckBounds(tile.content()))
      .result();
}

static Result<void> CheckBounds(const v1::Landmark& landmark) {
  return Bounds().Name("robot", landmark.robot()).result();
}

static Result<void> CheckBounds(const v1::LearnedValue& learned) {
  return Bounds().Name("name", learned.name()).Name("unit", learned.unit()).result();
}

static Result<void> CheckBounds(const v1::RobotStatus& robot) {
  return Bounds()
      .Inside("session", CheckBounds(robot.session()))
      .Inside("pose", CheckBounds(robot.pose()))
      .Each("ledgers", robot.ledgers(), kMaxSensors)
      .Each("learned", robot.learned(), kMostLearned)
      .result();
}

static Result<void> CheckBounds(const v1::SavedSite& saved) {
  return Bounds().Name("name", saved.name()).Name("site", saved.site()).result();
}

static Result<void> CheckBounds(const v1::Ros2DoorState& door) {
  return Bounds().Texts("problems", door.problems(), kMaxRos2Problems).result();
}

static Result<void> CheckBounds(const v1::Ros2Topic& topic) {
  return Bounds().Text("name", topic.name()).Text("type_name", topic.type_name()).result();
}

static Result<void> CheckBounds(const v1::Ros2Namespace& name_space) {
  return Bounds()
      .Text("name", name_space.name())
      .Name("robot", name_space.robot())
      .Name("site", name_space.site())
      .Texts("problems", name_space.problems(), kMaxRos2Problems)
      .Each("topics", name_space.topics(), kMaxRos2Topics)
      .result();
}

Result<void> CheckBounds(const v1::SessionRequest& request) {
  Bounds bounds;
  bounds.Name("robot", request.robot()).Name("site", request.site());
  bounds.AtMost("sensors", request.sensors().size(), kMaxSensors);
  for (const std::string& sensor : request.sensors()) bounds.Name("sensors", sensor);
  if (bounds.result() && request.robot_id() != HashName(request.robot())) {
    return Fail(StatusCode::kInvalidArgument, "robot_id: is not the hash of robot \"" + request.robot() + "\"");
  }
  return bounds.result();
}

Result<void> CheckBounds(const v1::SessionState& state) {
  return Bounds()
      .Name("robot", state.robot())
      .Name("site", state.site())
      .Known("phase", state.phase(), v1::SESSION_SUSPENDED)
      .Status("status", state.status())
      .result();
}

Result<void> CheckBounds(const v1::SessionRefusal& refusal) {
  return CheckBounds(refusal.state());
}

Result<void> CheckBounds(const v1::Scan& scan) {
  return Bounds().AtMost("ranges_m", scan.ranges_m().size(), kMaxRangesRead).result();
}

Result<void> CheckBounds(const v1::Odometry&) {
  return {};  // All members are numbers, so there is nothing to check.
}

Result<void> CheckBounds(const v1::PoseReport& report) {
  return Bounds()
      .Name("robot", report.robot())
      .Name("site", report.site())
      .Known("reason", report.reason(), v1::POSE_NOT_JOINED)
      .result();
}

Result<void> CheckBounds(const v1::Ledger& ledger) {
  return Bounds()
      .Name("robot", ledger.robot())
      .Name("sensor", ledger.sensor())
      .Name("site", ledger.site())
      .AtMost("dropped", ledger.dropped().size(), kMaxDropReasons)
      .result();
}

Result<void> CheckBounds(const v1::MapInfo& info) {
  return Bounds()
      .Name("site", info.site())
      .Each("versions", info.versions(), kMaxMapVersions)
      .Text("memory_note", info.memory_note())
      .result();
}

Result<void> CheckBounds(const v1::Tile& tile) {
  return Bounds()
      .Within("level", tile.level(), 0, kMaxTileLevel)
      .Inside("content", CheckBounds(tile.content()))
      .result();
}

Result<void> CheckBounds(const v1::Job& job) {
  return Bounds()
      .Name("site", job.site())
      .Known("kind", job.kind(), v1::JOB_RELOCALISE)
      .Known("state", job.state(), v1::JOB_CANCELLED)
      .Text("message", job.message())
      .Name("robot", job.robot())
      .AtMost("places", job.places().size(), kMostHypotheses)
      .result();
}

Result<void> CheckBounds(const v1::Request& request) {
  return Bounds()
      .Known("kind", request.kind(), v1::REQUEST_MAP_EDIT_REMOVE)
      .Name("site", request.site())
      .Name("robot", request.robot())
      .Within("level", request.level(), 0, kMaxTileLevel)
      .Known("job_kind", request.job_kind(), v1::JOB_RELOCALISE)
      .Name("saved", request.saved())
      .Inside("edit", CheckBounds(request.edit()))
      .result();
}

Result<void> CheckBounds(const v1::Reply& reply) {
  return Bounds()
      .Status("status", reply.status())
      .Each("poses", reply.poses(), kMaxReplyPoses)
      .AtMost("path", reply.path().size(), kMaxReplyPath)
      .Each("tiles", reply.tiles(), kMaxReplyTiles)
      .Each("landmarks", reply.landmarks(), kMaxReplyLandmarks)
      .Each("maps", reply.maps(), kMaxReplyMaps)
      .Each("robots", reply.robots(), kMaxReplyRobots)
      .Each("jobs", reply.jobs(), kMaxReplyJobs)
      .Text("server_version", reply.server_version())
      .Each("saved", reply.saved(), kMaxReplySaved)
      .AtMost("refused", reply.refused().size(), 1)
      .AtMost("load", reply.load().size(), 1)
      .Each("ros2", reply.ros2(), 1)
      .Each("ros2_namespaces", reply.ros2_namespaces(), kMaxReplyNamespaces)
      .Each("edits", reply.edits(), kMaxReplyEdits)
      .AtMost("hypotheses", reply.hypotheses().size(), kMostHypotheses)
      .result();
}

}  // namespace cairn::wire
