#include "tests/studies/logs.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include "client/sim/shipped_worlds.h"
#include "common/sensor/log_reader.h"
#include "tests/real_log_path.h"

namespace cairn::studies {
namespace {

// Relations between the pose at each metre and the one a given way further on.
std::vector<Relation> RelationsOf(const Trajectory& truth) {
  std::vector<double> way{0.0};
  for (std::size_t i = 1; i < truth.size(); ++i)
    way.push_back(way.back() + (truth[i].T_map_robot.translation() - truth[i - 1].T_map_robot.translation()).norm());
  std::vector<Relation> relations;
  for (const double apart : {1.0, 5.0, 20.0}) {
    double next = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (way[i] < next) continue;
      next = way[i] + 1.0;
      const auto end = std::lower_bound(way.begin() + static_cast<std::ptrdiff_t>(i), way.end(), way[i] + apart);
      if (end == way.end()) break;
      const StampedPose& other = truth[static_cast<std::size_t>(end - way.begin())];
      relations.push_back({truth[i].stamp, other.stamp, Between(truth[i].T_map_robot, other.T_map_robot)});
    }
  }
  return relations;
}

}  // namespace

std::size_t StudyLog::scans() const {
  return static_cast<std::size_t>(std::count_if(
      records.begin(), records.end(), [](const LogRecord& record) { return std::holds_alternative<Scan>(record); }));
}

double StudyLog::seconds() const {
  Stamp first = 0, last = 0;
  bool any = false;
  for (const LogRecord& record : records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr) continue;
    if (!any) first = scan->stamp;
    any = true;
    last = scan->stamp;
  }
  return SecondsFromStamp(last - first);
}

std::optional<StudyLog> OpenLogFile(StudyContext& context, const std::filesystem::path& path, int max_scans,
                                    const LidarTiming& timing) {
  StudyLog log;
  log.name = path.stem().string();
  int scans = 0;
  LogReaderOptions options;
  options.timing = timing;
  const auto read = ReadLog(path, options, [&](LogRecord&& record) {
    scans += std::holds_alternative<Scan>(record) ? 1 : 0;
    log.records.push_back(std::move(record));
    return max_scans <= 0 || scans < max_scans;
  });
  if (!read) {
    context.report.Warn("the log " + path.string() + " cannot be read: " + read.error().message);
    return std::nullopt;
  }
  const std::filesystem::path beside = std::filesystem::path(path).replace_extension(".relations");
  if (std::filesystem::exists(beside)) {
    auto relations = ReadRelations(beside);
    if (relations)
      log.relations = *std::move(relations);
    else
      context.report.Warn(relations.error().message);
  }
  return log;
}

std::optional<StudyLog> OpenRealLog(StudyContext& context, const std::string& name, int max_scans,
                                    const LidarTiming& timing) {
  for (const char* extension : {".clf", ".log"}) {
    const std::filesystem::path path = RealLog(name + extension);
    if (std::filesystem::exists(path)) return OpenLogFile(context, path, max_scans, timing);
  }
  context.report.Warn("the published log `" + name + "` is ABSENT (looked for " + RealLog(name).string() +
                      ".clf and .log; set CAIRN_DATA to the logs' folder)");
  return std::nullopt;
}

StudyLog SimulateLog(const std::string& world, double seconds, const sim::FleetOptions& options) {
  auto opened = sim::OpenWorld(world);
  if (!opened) throw std::invalid_argument(opened.error().message);
  opened->name = std::filesystem::path(world).stem().string();
  return SimulateLog(*std::move(opened), seconds, options);
}

StudyLog SimulateLog(sim::World world, double seconds, const sim::FleetOptions& options) {
  sim::FleetOptions one = options;
  one.robots = 1;
  StudyLog log;
  log.name = "simulated " + world.name;
  auto fleet = sim::Fleet::Create(std::move(world), one);
  if (!fleet) throw std::invalid_argument(fleet.error().message);
  log.T_map_robot_start = fleet->T_map_robot_start(0);
  const Stamp end = options.first_stamp + StampFromSeconds(seconds);
  Stamp stamp = 0;
  while (stamp <= end) {
    const LogRecord& record = log.records.emplace_back(fleet->Next().record);
    stamp = std::visit([](const auto& value) { return value.stamp; }, record);
  }
  log.records.pop_back();
  log.truth = fleet->truth(0);
  log.relations = RelationsOf(log.truth);
  return log;
}

std::vector<StudyLog> ChooseLogs(StudyContext& context, const std::vector<std::string>& names, int max_scans) {
  std::vector<StudyLog> logs;
  const auto keep = [&logs](std::optional<StudyLog> log) {
    if (log) logs.push_back(*std::move(log));
  };
  if (!context.logs.empty()) {
    for (const auto& path : context.logs) keep(OpenLogFile(context, path, max_scans));
    return logs;
  }
  for (const std::string& name : names) keep(OpenRealLog(context, name, max_scans));
  if (logs.empty()) {
    context.report.Warn(
        "no published log is available: a SIMULATED building is used instead, and its figures say "
        "nothing about real logs");
    sim::FleetOptions options;
    options.seed = context.seed;
    logs.push_back(SimulateLog("building", max_scans > 0 ? max_scans / options.scan_hz : 400.0, options));
  }
  return logs;
}

}  // namespace cairn::studies
