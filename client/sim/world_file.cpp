#include "client/sim/world_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <tuple>
#include <utility>
#include <vector>

#include "client/sim/closed_path.h"
#include "client/sim/wall.h"
#include "common/geometry/pose2.h"

namespace cairn::sim {
namespace {

constexpr double kMaxCoordinate_m = 10'000.0;
constexpr std::size_t kMaxSegments = 1'000'000;

// What a statement complains about; the caller adds source and line.
using WordComplaint = std::string;
using Words = std::vector<std::string>;

class Statement {
 public:
  explicit Statement(Words words) : words_(std::move(words)) {}

  [[nodiscard]] const std::string& keyword() const { return words_.front(); }
  [[nodiscard]] bool done() const { return next_ >= words_.size(); }

  tl::expected<std::string, WordComplaint> Word(const char* what) {
    if (done()) return tl::unexpected(std::string(what) + " is missing");
    return words_[next_++];
  }

  tl::expected<double, WordComplaint> Number(const char* what) {
    const auto word = Word(what);
    if (!word) return tl::unexpected(word.error());
    std::size_t used = 0;
    double value = 0.0;
    try {
      value = std::stod(*word, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used != word->size() || !std::isfinite(value) || std::abs(value) > kMaxCoordinate_m) {
      return tl::unexpected(std::string(what) + " '" + *word + "' is not a number of metres within +-10000");
    }
    return value;
  }

  tl::expected<double, WordComplaint> Positive(const char* what) {
    auto value = Number(what);
    if (value && *value <= 0.0) return tl::unexpected(std::string(what) + " must be above 0");
    return value;
  }

  tl::expected<Eigen::Vector2d, WordComplaint> Point() {
    const auto x = Number("x");
    if (!x) return tl::unexpected(x.error());
    const auto y = Number("y");
    if (!y) return tl::unexpected(y.error());
    return Eigen::Vector2d(*x, *y);
  }

  // All the points that are left, at least `least`; neighbours differ.
  tl::expected<std::vector<Eigen::Vector2d>, WordComplaint> Points(std::size_t least) {
    std::vector<Eigen::Vector2d> points;
    while (!done()) {
      const auto point = Point();
      if (!point) return tl::unexpected(point.error());
      if (!points.empty() && points.back() == *point) return tl::unexpected(WordComplaint("two equal points in a row"));
      points.push_back(*point);
    }
    if (points.size() < least) return tl::unexpected("needs at least " + std::to_string(least) + " points");
    return points;
  }

 private:
  Words words_;
  std::size_t next_ = 1;
};

using Outcome = tl::expected<void, WordComplaint>;

class WorldText {
 public:
  Outcome Take(Statement& statement) {
    static const std::vector<std::pair<std::string, Outcome (WorldText::*)(Statement&)>> kKinds = {
        {"name", &WorldText::Name},           {"thickness", &WorldText::Thickness}, {"wall", &WorldText::TakeWall},
        {"segment", &WorldText::TakeSegment}, {"polyline", &WorldText::Polyline},   {"polygon", &WorldText::Polygon},
        {"rectangle", &WorldText::Rectangle}, {"disc", &WorldText::TakeDisc},       {"walker", &WorldText::TakeWalker},
        {"route", &WorldText::TakeRoute}};
    const auto kind = std::find_if(kKinds.begin(), kKinds.end(),
                                   [&](const auto& entry) { return entry.first == statement.keyword(); });
    if (kind == kKinds.end()) return tl::unexpected(WordComplaint("not a statement of world files"));
    if (auto taken = (this->*kind->second)(statement); !taken) return taken;
    if (!statement.done()) return tl::unexpected(WordComplaint("more words than the statement takes"));
    if (world_.segments.size() > kMaxSegments) return tl::unexpected(WordComplaint("more than 1000000 segments"));
    return {};
  }

  World& world() { return world_; }

 private:
  Outcome Name(Statement& s) {
    auto name = s.Word("name");
    if (!name) return tl::unexpected(name.error());
    world_.name = *name;
    return {};
  }

  Outcome Thickness(Statement& s) {
    const auto thickness = s.Positive("thickness");
    if (!thickness) return tl::unexpected(thickness.error());
    thickness_m_ = *thickness;
    return {};
  }

  Outcome TakeWall(Statement& s) {
    const auto a = s.Point();
    if (!a) return tl::unexpected(a.error());
    const auto b = s.Point();
    if (!b) return tl::unexpected(b.error());
    Wall wall{*a, *b, thickness_m_, {}};
    if (*a == *b) return tl::unexpected(WordComplaint("a wall needs two different ends"));
    while (!s.done()) {
      if (*s.Word("gap") != "gap") return tl::unexpected(WordComplaint("after a wall's ends come only `gap FROM TO`"));
      const auto from = s.Number("gap's start");
      if (!from) return tl::unexpected(from.error());
      const auto to = s.Number("gap's end");
      if (!to) return tl::unexpected(to.error());
      const double after = wall.gaps.empty() ? 0.0 : wall.gaps.back().to_m;
      if (*from < after || *to <= *from || *to > (*b - *a).norm()) {
        return tl::unexpected(WordComplaint("gaps must be in order, inside the wall, and wider than 0"));
      }
      wall.gaps.push_back({*from, *to});
    }
    AppendWall(wall, &world_.segments);
    return {};
  }

  Outcome TakeSegment(Statement& s) {
    const auto points = s.Points(2);
    if (!points) return tl::unexpected(points.error());
    if (points->size() != 2) return tl::unexpected(WordComplaint("a segment has two points"));
    AppendChain(*points, false);
    return {};
  }

  Outcome Polyline(Statement& s) {
    const auto points = s.Points(2);
    if (!points) return tl::unexpected(points.error());
    AppendChain(*points, false);
    return {};
  }

  Outcome Polygon(Statement& s) {
    const auto points = s.Points(3);
    if (!points) return tl::unexpected(points.error());
    AppendChain(*points, true);
    return {};
  }

  // rectangle CENTER_X CENTER_Y WIDTH HEIGHT [DEGREES]
  Outcome Rectangle(Statement& s) {
    const auto center = s.Point();
    if (!center) return tl::unexpected(center.error());
    const auto width = s.Positive("width");
    if (!width) return tl::unexpected(width.error());
    const auto height = s.Positive("height");
    if (!height) return tl::unexpected(height.error());
    double degrees = 0.0;
    if (!s.done()) {
      const auto turn = s.Number("degrees");
      if (!turn) return tl::unexpected(turn.error());
      degrees = *turn;
    }
    const Pose2 T_map_box{center->x(), center->y(), WrapAngle(Radians(degrees))};
    const double w = *width / 2, h = *height / 2;
    AppendChain({T_map_box * Eigen::Vector2d(-w, -h), T_map_box * Eigen::Vector2d(w, -h),
                 T_map_box * Eigen::Vector2d(w, h), T_map_box * Eigen::Vector2d(-w, h)},
                true);
    return {};
  }

  Outcome TakeDisc(Statement& s) {
    const auto center = s.Point();
    if (!center) return tl::unexpected(center.error());
    const auto radius = s.Positive("radius");
    if (!radius) return tl::unexpected(radius.error());
    world_.discs.push_back({*center, *radius});
    return {};
  }

  // walker RADIUS SPEED x y x y ...
  Outcome TakeWalker(Statement& s) {
    const auto radius = s.Positive("radius");
    if (!radius) return tl::unexpected(radius.error());
    const auto speed = s.Positive("speed");
    if (!speed) return tl::unexpected(speed.error());
    auto path = s.Points(2);
    if (!path) return tl::unexpected(path.error());
    world_.walkers.push_back({*radius, *speed, std::move(*path)});
    return {};
  }

  Outcome TakeRoute(Statement& s) {
    auto name = s.Word("name");
    if (!name) return tl::unexpected(name.error());
    auto waypoints = s.Points(2);
    if (!waypoints) return tl::unexpected(waypoints.error());
    world_.routes.push_back({*name, std::move(*waypoints)});
    return {};
  }

  void AppendChain(const std::vector<Eigen::Vector2d>& points, bool closed) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i) world_.segments.push_back({points[i], points[i + 1]});
    if (closed) world_.segments.push_back({points.back(), points.front()});
  }

  World world_;
  double thickness_m_ = 0.12;
};

Words SplitWords(std::string line) {
  if (const auto comment = line.find('#'); comment != std::string::npos) line.erase(comment);
  std::istringstream stream(line);
  Words words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

}  // namespace

Result<World> ParseWorld(std::string_view text, const std::string& source) {
  std::istringstream stream{std::string(text)};
  WorldText reader;
  Words words;
  int line_number = 0, first_line = 0;
  bool header = false;
  const auto fail = [&](const std::string& why) {
    return Fail(StatusCode::kInvalidArgument, source + ":" + std::to_string(first_line) + ": " + why);
  };
  for (std::string line; std::getline(stream, line);) {
    ++line_number;
    Words more = SplitWords(line);
    if (words.empty()) first_line = line_number;
    const bool joins = !more.empty() && more.back() == "\\";
    if (joins) more.pop_back();
    words.insert(words.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
    if (joins || words.empty()) continue;
    if (!header) {
      if (words != Words{"cairn-world", "1"}) return fail("the first statement must be `cairn-world 1`");
      header = true;
    } else {
      Statement statement(std::move(words));
      if (const auto taken = reader.Take(statement); !taken) return fail(statement.keyword() + ": " + taken.error());
    }
    words.clear();
  }
  first_line = line_number;
  if (!words.empty()) return fail("the text ends within a joined line");
  if (!header) return fail("the first statement must be `cairn-world 1`");
  if (reader.world().segments.empty() && reader.world().discs.empty()) return fail("the world is empty");
  return std::move(reader.world());
}

Result<World> ReadWorldFile(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (file) text << file.rdbuf();
  if (!file || std::filesystem::is_directory(path)) {
    return Fail(StatusCode::kNotFound, path.string() + ": cannot be read");
  }
  auto world = ParseWorld(text.str(), path.string());
  if (world && world->name.empty()) world->name = path.stem().string();
  return world;
}

}  // namespace cairn::sim
