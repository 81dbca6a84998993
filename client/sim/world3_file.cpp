#include "client/sim/world3_file.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <cmath>
#include <initializer_list>
#include <set>

#include "common/file/atomic_file.h"
#include "common/geometry/pose2.h"

namespace cairn::sim {
namespace {

constexpr double kMaxCoordinate3_m = 1000.0;
constexpr std::size_t kMaxRectangles = 100'000;
constexpr std::size_t kMaxBytes = 16u << 20;
constexpr double kUnset = std::numeric_limits<double>::quiet_NaN();

// Thrown and caught in this file only, as yaml-cpp's own are.
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
      std::abs(value) > kMaxCoordinate3_m)
    Complain(node, what + " must be a number within +-1000");
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

// The keys of one map, each taken once; what is left over is a mistake.
class Keys {
 public:
  Keys(const YAML::Node& node, std::string what) : node_(node), what_(std::move(what)) {
    if (!node.IsMap()) Complain(node, what_ + " must be a map");
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) Complain(entry.first, what_ + ": a key must be a word");
      if (!left_.insert(entry.first.Scalar()).second)
        Complain(entry.first, what_ + ": '" + entry.first.Scalar() + "' is there twice");
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
  double Number(const std::string& key, double otherwise = kUnset) {
    if (std::isnan(otherwise)) return Metres(Must(key), what_ + ": " + key);
    const YAML::Node value = Take(key);
    return value.IsDefined() ? Metres(value, what_ + ": " + key) : otherwise;
  }
  double Positive(const std::string& key, double otherwise = kUnset) {
    const double value = Number(key, otherwise);
    if (value <= 0.0) Complain(node_, what_ + ": " + key + " must be above 0");
    return value;
  }
  Eigen::Vector2d Point2(const std::string& key) { return Point<2>(Must(key), what_ + ": " + key); }
  void End() const {
    if (!left_.empty()) Complain(node_, what_ + ": '" + *left_.begin() + "' is not a key of it");
  }

  [[nodiscard]] const YAML::Node& node() const { return node_; }

 private:
  YAML::Node node_;
  std::string what_;
  std::set<std::string> left_;
};

void RequireRise(const Keys& keys, double bottom, double top) {
  if (top <= bottom) Complain(keys.node(), "top must be above bottom");
}

Rectangle TakeRectangle(Keys& keys) {
  const YAML::Node corners = keys.Must("corners");
  if (!corners.IsSequence() || corners.size() < 3 || corners.size() > 4)
    Complain(corners, "a rectangle has three corners in a row, or all four");
  const auto p = [&](std::size_t i) { return Point<3>(corners[i], "corner"); };
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
  Box box{keys.Point2("center"), keys.Point2("size"), Radians(keys.Number("degrees", 0.0)), keys.Number("bottom", 0.0),
          keys.Number("top")};
  if ((box.size_m.array() <= 0.0).any()) Complain(keys.node(), "a box needs a size");
  RequireRise(keys, box.bottom_m, box.top_m);
  return box;
}

Wall3 TakeWall(Keys& keys) {
  Wall3 wall;
  wall.a_map = keys.Point2("from");
  wall.b_map = keys.Point2("to");
  wall.thickness_m = keys.Positive("thickness", wall.thickness_m);
  wall.bottom_m = keys.Number("bottom", wall.bottom_m);
  wall.top_m = keys.Number("top", wall.top_m);
  RequireRise(keys, wall.bottom_m, wall.top_m);
  if (wall.a_map == wall.b_map) Complain(keys.node(), "a wall needs two different ends");
  const YAML::Node openings = keys.Take("openings");
  if (!openings.IsDefined()) return wall;
  if (!openings.IsSequence()) Complain(openings, "openings must be a list");
  double after = 0.0;
  for (const YAML::Node& node : openings) {
    Keys opening_keys(node, "opening");
    const Opening opening{opening_keys.Number("from"), opening_keys.Number("to"),
                          opening_keys.Number("bottom", wall.bottom_m), opening_keys.Number("top")};
    opening_keys.End();
    if (opening.from_m < after || opening.to_m <= opening.from_m || opening.to_m > (wall.b_map - wall.a_map).norm() ||
        opening.bottom_m < wall.bottom_m || opening.top_m <= opening.bottom_m || opening.top_m > wall.top_m)
      Complain(node, "openings must be in order, inside the wall, and larger than nothing");
    after = opening.to_m;
    wall.openings.push_back(opening);
  }
  return wall;
}

Pillar TakePillar(Keys& keys) {
  Pillar pillar;
  pillar.center_map = keys.Point2("center");
  pillar.radius_m = keys.Positive("radius");
  pillar.bottom_m = keys.Number("bottom", pillar.bottom_m);
  pillar.top_m = keys.Number("top", pillar.top_m);
  RequireRise(keys, pillar.bottom_m, pillar.top_m);
  const double sides = keys.Number("sides", pillar.sides);
  if (sides < 3 || sides > 360 || sides != std::floor(sides)) Complain(keys.node(), "sides must be 3..360");
  pillar.sides = static_cast<int>(sides);
  return pillar;
}

Route TakeRoute(Keys& keys) {
  Route route;
  route.name = keys.Must("name").as<std::string>("");
  const YAML::Node points = keys.Must("points");
  if (!points.IsSequence() || points.size() < 2) Complain(points, "a route needs at least 2 points");
  for (const YAML::Node& node : points) {
    const Eigen::Vector2d point = Point<2>(node, "point");
    if (!route.waypoints_map.empty() && route.waypoints_map.back() == point)
      Complain(node, "two equal points in a row");
    route.waypoints_map.push_back(point);
  }
  return route;
}

// Every element of an optional list of maps.
template <typename Take>
void ForEach(Keys& keys, const std::string& list, const std::string& what, const Take& take) {
  const YAML::Node nodes = keys.Take(list);
  if (!nodes.IsDefined()) return;
  if (!nodes.IsSequence()) Complain(nodes, list + " must be a list");
  for (const YAML::Node& node : nodes) {
    Keys element(node, what);
    take(element);
    element.End();
  }
}

World3 TakeWorld(const YAML::Node& root) {
  Keys keys(root, "world");
  if (keys.Must("cairn-world3").as<std::string>("") != "1") Complain(root, "the file must say `cairn-world3: 1`");
  World3 world;
  world.name = keys.Take("name").as<std::string>("");
  std::vector<Rectangle>& rectangles = world.rectangles;
  const auto check = [&](const Keys& element) {
    if (rectangles.size() > kMaxRectangles) Complain(element.node(), "more than 100000 rectangles");
  };
  ForEach(keys, "rectangles", "rectangle", [&](Keys& k) { rectangles.push_back(TakeRectangle(k)), check(k); });
  ForEach(keys, "slabs", "slab", [&](Keys& k) { rectangles.push_back(TakeSlab(k)), check(k); });
  ForEach(keys, "boxes", "box", [&](Keys& k) { AppendBox(TakeBox(k), &rectangles), check(k); });
  ForEach(keys, "walls", "wall", [&](Keys& k) { AppendWall(TakeWall(k), &rectangles), check(k); });
  ForEach(keys, "pillars", "pillar", [&](Keys& k) { AppendPillar(TakePillar(k), &rectangles), check(k); });
  ForEach(keys, "routes", "route", [&](Keys& k) { world.routes.push_back(TakeRoute(k)); });
  keys.End();
  if (rectangles.empty()) Complain(root, "the world is empty");
  return world;
}

}  // namespace

Result<World3> ParseWorld3(const std::string& text, const std::string& source) {
  const auto fail = [&](const YAML::Mark& mark, const std::string& why) {
    return Fail(StatusCode::kInvalidArgument, source + ":" + std::to_string(mark.line + 1) + ": " + why);
  };
  try {
    return TakeWorld(YAML::Load(text));
  } catch (const Complaint& complaint) {
    return fail(complaint.mark, complaint.why);
  } catch (const YAML::Exception& error) {
    return fail(error.mark, error.msg);
  }
}

Result<World3> ReadWorld3File(const std::filesystem::path& path) {
  const auto bytes = ReadWholeFile(path, kMaxBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  auto world = ParseWorld3({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path.string());
  if (world && world->name.empty()) world->name = path.stem().string();
  return world;
}

}  // namespace cairn::sim
