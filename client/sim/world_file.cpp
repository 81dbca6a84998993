#include "client/sim/world_file.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "client/sim/world.h"
#include "common/geometry/pose2.h"
#include "common/options/config.h"

namespace cairn::sim {
namespace {

constexpr double kMaxCoordinate_m = 10'000.0;
constexpr std::size_t kMaxElements = 1'000'000;  // List elements read; an alias repeats a long list with few letters.
constexpr std::size_t kMaxSegments = 1'000'000;
constexpr std::size_t kMaxRectangles = 100'000;
constexpr double kRequired = std::numeric_limits<double>::quiet_NaN();
constexpr char kFlat[] = "cairn-world", kSpatial[] = "cairn-world3";

// Thrown and caught in this file only, as yaml-cpp's own exceptions are.
struct Complaint {
  YAML::Mark mark;
  std::string why;
};

[[noreturn]] void Complain(const YAML::Node& node, const std::string& why) {
  throw Complaint{node.Mark(), why};
}

double Metres(const YAML::Node& node, const std::string& what) {
  double value = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value) ||
      std::abs(value) > kMaxCoordinate_m)
    Complain(node, what + " must be a number from -10000 to 10000");
  return value;
}

template <int Size>
Eigen::Matrix<double, Size, 1> Point(const YAML::Node& node, const std::string& what) {
  if (!node.IsSequence() || node.size() != Size)
    Complain(node, what + " must be a list of " + std::to_string(Size) + " numbers");
  Eigen::Matrix<double, Size, 1> point;
  for (int i = 0; i < Size; ++i) point(i) = Metres(node[static_cast<std::size_t>(i)], what);
  return point;
}

// The keys of one YAML map. Each is taken once; a key that nobody took is a mistake of the file (Finish).
class Keys {
 public:
  // `elements_left` counts down over the whole document.
  Keys(const YAML::Node& node, std::string what, std::size_t* elements_left)
      : node_(node), what_(std::move(what)), elements_left_(elements_left) {
    if (!node.IsMap()) Complain(node, what_ + " must be a map of keys and values");
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) Complain(entry.first, what_ + ": a key must be a word");
      if (!left_.insert(entry.first.Scalar()).second)
        Complain(entry.first, what_ + ": '" + entry.first.Scalar() + "' is given twice");
    }
  }

  // The value; undefined where the key is absent.
  YAML::Node Take(const std::string& key) {
    left_.erase(key);
    return node_[key];
  }
  YAML::Node Must(const std::string& key) {
    YAML::Node value = Take(key);
    if (!value.IsDefined()) Complain(node_, what_ + ": '" + key + "' is missing");
    return value;
  }
  std::string Word(const std::string& key) {
    const YAML::Node value = Must(key);
    if (!value.IsScalar() || value.Scalar().empty()) Complain(value, what_ + ": " + key + " must be a word");
    return value.Scalar();
  }
  double Number(const std::string& key, double default_value = kRequired) {
    if (std::isnan(default_value)) return Metres(Must(key), what_ + ": " + key);
    const YAML::Node value = Take(key);
    return value.IsDefined() ? Metres(value, what_ + ": " + key) : default_value;
  }
  double Positive(const std::string& key, double default_value = kRequired) {
    const double value = Number(key, default_value);
    if (value <= 0.0) Complain(node_[key], what_ + ": " + key + " must be above 0");
    return value;
  }
  Eigen::Vector2d Point2(const std::string& key) { return Point<2>(Must(key), what_ + ": " + key); }
  // A list of at least `least` points, of which neighbours differ.
  std::vector<Eigen::Vector2d> Points(std::size_t least) {
    const YAML::Node nodes = Must("points");
    if (!nodes.IsSequence() || nodes.size() < least)
      Complain(nodes, what_ + " needs at least " + std::to_string(least) + " points");
    std::vector<Eigen::Vector2d> points;
    for (const YAML::Node& node : nodes) {
      CountElement(node);
      const Eigen::Vector2d point = Point<2>(node, "a point");
      if (!points.empty() && points.back() == point) Complain(node, what_ + ": two equal points in a row");
      points.push_back(point);
    }
    return points;
  }
  // Every element of a list that may be absent.
  template <typename TakeElement>
  void ForEach(const std::string& list, const TakeElement& take) {
    const YAML::Node nodes = Take(list);
    if (!nodes.IsDefined()) return;
    if (!nodes.IsSequence()) Complain(nodes, list + " must be a list");
    for (const YAML::Node& node : nodes) {
      CountElement(node);
      take(node);
    }
  }
  // The same where elements are maps. `what` names one of them in errors.
  template <typename TakeElement>
  void ForEachMap(const std::string& list, const std::string& what, const TakeElement& take) {
    ForEach(list, [&](const YAML::Node& node) {
      Keys element(node, what, elements_left_);
      take(element);
      element.Finish();
    });
  }
  void Finish() const {
    if (!left_.empty()) Complain(node_, what_ + ": '" + *left_.begin() + "' is not a key of it");
  }

  [[nodiscard]] const YAML::Node& node() const { return node_; }

 private:
  void CountElement(const YAML::Node& node) {
    if ((*elements_left_)-- == 0) Complain(node, "more than 1000000 list elements");
  }

  YAML::Node node_;
  std::string what_;
  std::size_t* elements_left_;
  std::set<std::string> left_;
};

// Centre line and thickness, which walls of both kinds share.
template <typename AnyWall>
double TakeWallLine(Keys& keys, AnyWall& wall) {
  wall.a_map = keys.Point2("from");
  wall.b_map = keys.Point2("to");
  wall.thickness_m = keys.Positive("thickness", wall.thickness_m);
  if (wall.a_map == wall.b_map) Complain(keys.node(), "a wall needs two different ends");
  return (wall.b_map - wall.a_map).norm();
}

Route TakeRoute(Keys& keys) {
  return {keys.Word("name"), keys.Points(2)};
}

void CheckRise(const Keys& keys, double bottom, double top) {
  if (top <= bottom) Complain(keys.node(), "top must be above bottom");
}

// What stands on the floor as a turned rectangle. In a flat world it has no height.
Box TakeGroundPlan(Keys& keys) {
  Box box;
  box.center_map = keys.Point2("center");
  box.size_m = keys.Point2("size");
  box.turn_rad = Radians(keys.Number("degrees", 0.0));
  if ((box.size_m.array() <= 0.0).any()) Complain(keys.node(), "both sizes of a box must be above 0");
  return box;
}

// --- Flat worlds.

Wall TakeWall(Keys& keys) {
  Wall wall;
  const double length = TakeWallLine(keys, wall);
  keys.ForEach("gaps", [&](const YAML::Node& node) {
    const Eigen::Vector2d gap = Point<2>(node, "a gap");
    const double after = wall.gaps.empty() ? 0.0 : wall.gaps.back().to_m;
    if (gap(0) < after || gap(1) <= gap(0) || gap(1) > length)
      Complain(node, "gaps must be in order, inside the wall, and wider than 0");
    wall.gaps.push_back({gap(0), gap(1)});
  });
  return wall;
}

void AppendChain(const std::vector<Eigen::Vector2d>& points, bool closed, std::vector<Segment>* segments) {
  for (std::size_t i = 0; i + 1 < points.size(); ++i) segments->push_back({points[i], points[i + 1]});
  if (closed) segments->push_back({points.back(), points.front()});
}

void TakeLine(Keys& keys, std::vector<Segment>* segments) {
  bool closed = false;
  if (const YAML::Node value = keys.Take("closed"); value.IsDefined() && !YAML::convert<bool>::decode(value, closed))
    Complain(value, "closed must be true or false");
  AppendChain(keys.Points(closed ? 3 : 2), closed, segments);
}

void TakeFlatBox(Keys& keys, std::vector<Segment>* segments) {
  const Box box = TakeGroundPlan(keys);
  const Pose2 T_map_box{box.center_map.x(), box.center_map.y(), WrapAngle(box.turn_rad)};
  const double w = box.size_m.x() / 2, h = box.size_m.y() / 2;
  AppendChain({T_map_box * Eigen::Vector2d(-w, -h), T_map_box * Eigen::Vector2d(w, -h),
               T_map_box * Eigen::Vector2d(w, h), T_map_box * Eigen::Vector2d(-w, h)},
              true, segments);
}

Door TakeDoor(Keys& keys) {
  constexpr double kWidest_m = 10.0;
  Door door{keys.Point2("from"), keys.Point2("to"), keys.Positive("closed"), keys.Positive("open"),
            keys.Number("begin", 0.0)};
  if (door.a_map == door.b_map || (door.b_map - door.a_map).norm() > kWidest_m)
    Complain(keys.node(), "a door must be wider than 0, and at most 10 m");
  if (door.begin_s < 0.0) Complain(keys.node(), "begin must not be below 0");
  return door;
}

Pane TakePane(Keys& keys) {
  Pane pane{keys.Point2("from"), keys.Point2("to"), Radians(keys.Number("seen", Degrees(kDefaultSeenRad)))};
  if (pane.a_map == pane.b_map) Complain(keys.node(), "a pane needs two different ends");
  if (pane.seen_rad < 0.0 || pane.seen_rad > kPi / 2) Complain(keys.node(), "seen must be from 0 to 90 degrees");
  return pane;
}

World TakeWorld(Keys& keys) {
  World world;
  std::vector<Segment>& segments = world.segments;
  const auto check = [&](const Keys& element) {
    if (segments.size() > kMaxSegments) Complain(element.node(), "more than 1000000 segments");
  };
  keys.ForEachMap("walls", "wall", [&](Keys& k) { AppendWall(TakeWall(k), &segments), check(k); });
  keys.ForEachMap("lines", "line", [&](Keys& k) { TakeLine(k, &segments), check(k); });
  keys.ForEachMap("boxes", "box", [&](Keys& k) { TakeFlatBox(k, &segments), check(k); });
  keys.ForEachMap("pillars", "pillar", [&](Keys& k) {
    world.discs.push_back({k.Point2("center"), k.Positive("radius")});
  });
  keys.ForEachMap("walkers", "walker", [&](Keys& k) {
    world.walkers.push_back({k.Positive("radius"), k.Positive("speed"), k.Points(2)});
  });
  keys.ForEachMap("doors", "door", [&](Keys& k) { world.doors.push_back(TakeDoor(k)); });
  keys.ForEachMap("glass", "pane", [&](Keys& k) { world.panes.push_back(TakePane(k)); });
  return world;
}

// --- Worlds in space.

Rectangle TakeRectangle(Keys& keys) {
  const YAML::Node corners = keys.Must("corners");
  if (!corners.IsSequence() || corners.size() < 3 || corners.size() > 4)
    Complain(corners, "a rectangle has three corners in a row, or all four");
  const auto p = [&](std::size_t i) { return Point<3>(corners[i], "a corner"); };
  const Eigen::Vector3d a = p(0), b = p(1), c = p(2);
  Rectangle rectangle{b, a - b, c - b};
  const double area = rectangle.side_a.cross(rectangle.side_b).norm();
  if (area < 1e-9) Complain(corners, "a rectangle needs an area");
  if (std::abs(rectangle.side_a.dot(rectangle.side_b)) > 1e-6 * area)
    Complain(corners, "the sides of a rectangle must be at right angles");
  if (corners.size() == 4 && (p(3) - (a + c - b)).norm() > 1e-6)
    Complain(corners, "the fourth corner does not close the rectangle");
  return rectangle;
}

Rectangle TakeSlab(Keys& keys) {
  const Eigen::Vector2d from = keys.Point2("from"), to = keys.Point2("to");
  if (from.x() == to.x() || from.y() == to.y()) Complain(keys.node(), "a slab needs an area");
  return Slab(from, to, keys.Number("height"));
}

Box TakeBox(Keys& keys) {
  Box box = TakeGroundPlan(keys);
  box.bottom_m = keys.Number("bottom", 0.0);
  box.top_m = keys.Number("top");
  CheckRise(keys, box.bottom_m, box.top_m);
  return box;
}

Wall3 TakeWall3(Keys& keys) {
  Wall3 wall;
  const double length = TakeWallLine(keys, wall);
  wall.bottom_m = keys.Number("bottom", wall.bottom_m);
  wall.top_m = keys.Number("top", wall.top_m);
  CheckRise(keys, wall.bottom_m, wall.top_m);
  keys.ForEachMap("openings", "opening", [&](Keys& k) {
    const Opening opening{k.Number("from"), k.Number("to"), k.Number("bottom", wall.bottom_m), k.Number("top")};
    const double after = wall.openings.empty() ? 0.0 : wall.openings.back().to_m;
    if (opening.from_m < after || opening.to_m <= opening.from_m || opening.to_m > length ||
        opening.bottom_m < wall.bottom_m || opening.top_m <= opening.bottom_m || opening.top_m > wall.top_m)
      Complain(k.node(), "openings must be in order, inside the wall, and larger than nothing");
    wall.openings.push_back(opening);
  });
  return wall;
}

Pillar TakePillar(Keys& keys) {
  Pillar pillar;
  pillar.center_map = keys.Point2("center");
  pillar.radius_m = keys.Positive("radius");
  pillar.bottom_m = keys.Number("bottom", pillar.bottom_m);
  pillar.top_m = keys.Number("top", pillar.top_m);
  CheckRise(keys, pillar.bottom_m, pillar.top_m);
  const double sides = keys.Number("sides", pillar.sides);
  if (sides < 3 || sides > 360 || sides != std::floor(sides))
    Complain(keys.node(), "sides must be a whole number from 3 to 360");
  pillar.sides = static_cast<int>(sides);
  return pillar;
}

World3 TakeWorld3(Keys& keys) {
  World3 world;
  std::vector<Rectangle>& rectangles = world.rectangles;
  const auto check = [&](const Keys& element) {
    if (rectangles.size() > kMaxRectangles) Complain(element.node(), "more than 100000 rectangles");
  };
  keys.ForEachMap("rectangles", "rectangle", [&](Keys& k) { rectangles.push_back(TakeRectangle(k)), check(k); });
  keys.ForEachMap("slabs", "slab", [&](Keys& k) { rectangles.push_back(TakeSlab(k)), check(k); });
  keys.ForEachMap("boxes", "box", [&](Keys& k) { AppendBox(TakeBox(k), &rectangles), check(k); });
  keys.ForEachMap("walls", "wall", [&](Keys& k) { AppendWall(TakeWall3(k), &rectangles), check(k); });
  keys.ForEachMap("pillars", "pillar", [&](Keys& k) { AppendPillar(TakePillar(k), &rectangles), check(k); });
  return world;
}

// --- Both kinds.

bool IsEmpty(const World& world) {
  return world.segments.empty() && world.discs.empty();
}

bool IsEmpty(const World3& world) {
  return world.rectangles.empty();
}

template <typename AnyWorld>
AnyWorld TakeDocument(const YAML::Node& root, const char* kind, AnyWorld (*take)(Keys&)) {
  std::size_t elements_left = kMaxElements;
  Keys keys(root, "world", &elements_left);
  if (keys.Word(kind) != "1") Complain(root, std::string("the file must say `") + kind + ": 1`");
  std::string name;
  if (root["name"].IsDefined()) name = keys.Word("name");
  AnyWorld world = take(keys);
  keys.ForEachMap("routes", "route", [&](Keys& k) { world.routes.push_back(TakeRoute(k)); });
  keys.Finish();
  if (IsEmpty(world)) Complain(root, "the world is empty");
  world.name = name;
  return world;
}

template <typename Value, typename Read>
Result<Value> ReadDocument(const std::string& text, const std::string& source, const Read& read) {
  const auto fail = [&](const YAML::Mark& mark, const std::string& why) {
    const bool known = mark.line >= 0;
    const std::string place =
        known ? ":" + std::to_string(mark.line + 1) + ":" + std::to_string(mark.column + 1) : std::string();
    return Fail(StatusCode::kInvalidArgument, source + place + ": " + why);
  };
  if (text.size() > kMaxWorldBytes) return fail(YAML::Mark::null_mark(), "longer than 1 MiB");
  try {
    const YAML::Node root = YAML::Load(text);
    if (!root.IsMap())
      Complain(root, "a world must begin with `cairn-world: 1` (flat) or `cairn-world3: 1` (in space)");
    Value value = read(root);
    if (const auto line = LineAfterFirstDocument(text))
      return Fail(StatusCode::kInvalidArgument,
                  source + ":" + std::to_string(*line + 1) + ":1: a world file holds one YAML document");
    return value;
  } catch (const Complaint& complaint) {
    return fail(complaint.mark, complaint.why);
  } catch (const YAML::Exception& error) {
    return fail(error.mark, "not YAML: " + error.msg);
  }
}

}  // namespace

Result<World> ParseWorld(const std::string& text, const std::string& source) {
  return ReadDocument<World>(text, source,
                             [](const YAML::Node& root) { return TakeDocument(root, kFlat, &TakeWorld); });
}

Result<World3> ParseWorld3(const std::string& text, const std::string& source) {
  return ReadDocument<World3>(text, source,
                              [](const YAML::Node& root) { return TakeDocument(root, kSpatial, &TakeWorld3); });
}

Result<Surroundings> ParseSurroundings(const std::string& text, const std::string& source) {
  return ReadDocument<Surroundings>(text, source, [](const YAML::Node& root) {
    return root[kSpatial].IsDefined() ? SurroundingsOf(TakeDocument(root, kSpatial, &TakeWorld3))
                                      : SurroundingsOf(TakeDocument(root, kFlat, &TakeWorld));
  });
}

}  // namespace cairn::sim
