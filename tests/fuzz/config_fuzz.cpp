// Text that people write: a number, then a configuration of the server, a list of `key=value`, or a simulated world. An
// accepted configuration is within every range and rule, prints as itself, and an estimator can be made with it.
#include <cmath>
#include <optional>
#include <sstream>

#include "client/sim/world_file.h"
#include "common/options/config.h"
#include "server/options.h"
#include "server/slam/mapper.h"
#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {
namespace {

VisitOptions OptionsOf(server::ServerOptions& options) {
  return [&options](OptionVisitor& visitor) { Visit(visitor, options); };
}

bool UseOptions(const Result<void>& applied, server::ServerOptions& options) {
  server::ServerOptions defaults;
  if (!applied) {
    Must(!applied.error().message.empty(), "a refusal has a reason");
    Must(PrintYaml(OptionsOf(options)) == PrintYaml(OptionsOf(defaults)), "a refusal changes nothing");
    return false;
  }
  const std::string printed = PrintYaml(OptionsOf(options));
  server::ServerOptions again;
  Must(ApplyYaml(printed, "printed", OptionsOf(again)).has_value(), "what is printed can be read");
  Must(PrintYaml(OptionsOf(again)) == printed, "it reads back as the same configuration");
  static_cast<void>(options.server.site_names());
  if (!CheckRules(OptionsOf(options)) || !slam::Validate(options.slam)) return true;
  // A known map would be read from a file.
  const bool small = options.slam.filter.particles <= 200;
  if (!small || options.slam.filter.kind == slam::FilterKind::kLineMatch) return true;
  slam::Mapper mapper(options.slam, {}, 1);
  Must(mapper.keyframe_count() == 0, "an estimator begins empty");
  return true;
}

bool RunYaml(const std::string& text) {
  server::ServerOptions options;
  return UseOptions(ApplyYaml(text, "fuzz", OptionsOf(options)), options);
}

bool RunSet(const std::string& text) {
  std::vector<std::string> assignments;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) assignments.push_back(line);
  server::ServerOptions options;
  return UseOptions(ApplySet(assignments, OptionsOf(options)), options);
}

bool RunWorld(const std::string& text) {
  const auto surroundings = sim::ParseSurroundings(text, "fuzz");
  if (!surroundings) {
    Must(surroundings.error().message.rfind("fuzz", 0) == 0, "a refusal names its source");
    return false;
  }
  for (const sim::Route& route : surroundings->routes) {
    Must(route.waypoints_map.size() >= 2, "a route has a beginning and an end");
    for (const Eigen::Vector2d& point : route.waypoints_map) Must(point.allFinite(), "a route is finite");
  }
  const double range_m = surroundings->scene->Cast({3.1, 1.7, 0.4}, {0.6, 0.8, 0.0}, 100.0);
  Must(range_m >= 0.0, "a range is a distance or infinity, and not NaN");
  return true;
}

bool RunConfig(std::string_view input) {
  Pieces pieces(input);
  const std::uint8_t kind = pieces.Take() % 3;
  const std::string text(pieces.rest());
  return kind == 0 ? RunYaml(text) : kind == 1 ? RunSet(text) : RunWorld(text);
}

std::vector<std::string> SeedsOfTexts() {
  const auto seed = [](char kind, const std::string& text) { return std::string(1, kind) + text; };
  return {
      seed(0, "server: {threads: 2, sites: 'lab, hall', create_sites: false}\n"),
      seed(0, "slam:\n  particles: 50\n  filter: ekf\n  matcher: ndt\nexpert:\n  slam:\n    grid: {max_ray_m: 12.5}\n"),
      seed(0, "maps:\n  publish_rate_hz: 2\nrobots:\n  max_robots: 16\njobs:\nstore: {max_gib: 1.5}\n"),
      seed(0, "# nothing\n"),
      seed(1, "slam.particles=50\nslam.filter=dpslam\nserver.log_level=debug"),
      seed(2,
           "cairn-world: 1\nname: hall\nwalls:\n  - {from: [0, 0], to: [9, 0], thickness: 0.2, gaps: [[1, 2]]}\n"
           "lines:\n  - {points: [[0, 0], [1, 0], [1, 1]], closed: true}\n"
           "boxes: [{center: [5, 5], size: [2, 1], degrees: 9}]\npillars: [{center: [1, 2], radius: 0.3}]\n"
           "walkers: [{radius: 0.2, speed: 0.7, points: [[0, 0], [4, 0]]}]\n"
           "routes:\n  - name: r\n    points: [[0, 0], [1, 1], [2, 0]]\n"),
      seed(2,
           "cairn-world3: 1\nname: hall\nslabs: [{from: [0, 0], to: [24, 14], height: 0}]\n"
           "rectangles: [{corners: [[0, 0, 0], [2, 0, 0], [2, 0, 1]]}]\n"
           "walls: [{from: [0, 0], to: [9, 0], top: 2.5, openings: [{from: 1, to: 2, top: 2}]}]\n"
           "boxes: [{center: [1, 4], size: [0.6, 1.6], top: 1.9, degrees: 20}]\n"
           "pillars: [{center: [8, 1], radius: 0.3, top: 4, sides: 16}]\n"
           "routes: [{name: r, points: [[0, 0], [1, 1]]}]\n")};
}

const bool kConfigTarget = Register({"config", &RunConfig, &SeedsOfTexts});

}  // namespace
}  // namespace cairn::fuzz
