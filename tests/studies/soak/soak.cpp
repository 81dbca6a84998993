// cairn-study soak lets a robot drive for a day of simulated time, as fast as a cairnd takes its scans, and then stand
// for some hours: memory, disk, time from scan to pose, and the time that a restart would take, against time. What
// grows although the robot only stands is kept for nothing. Then it measures the memory of sessions that do nothing.
// --hours: of the drive (24); --only driving|standing|idle.
#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "client/sim/shipped_worlds.h"
#include "tests/eventually.h"
#include "tests/loopback.h"
#include "tests/studies/soak/fast_robot.h"
#include "tests/studies/soak/soaked_server.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

constexpr double kScanRate_hz = 10.0;
constexpr double kWarmUp = 0.25;  // Share of a phase before the slopes: buffers grow to their sizes.
constexpr int kIdleSessions = 64;

struct Sample {
  double hours = 0.0;
  double resident_mib = 0.0;
  double disk_mib = 0.0;
  double p50_ms = 0.0;
  double p99_ms = 0.0;
  double restart_s = 0.0;
  double keyframes = 0.0;
};

// A figure of the samples, and how much it may grow in an hour.
struct Figure {
  const char* name;
  const char* unit;
  double Sample::*value;
  double most_per_hour;
  int decimals;
};

// Least squares.
double SlopePerHour(const std::vector<Sample>& samples, double Sample::*value) {
  const auto first = static_cast<std::size_t>(kWarmUp * static_cast<double>(samples.size()));
  const auto count = static_cast<double>(samples.size() - first);
  double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  for (std::size_t i = first; i < samples.size(); ++i) {
    x += samples[i].hours / count;
    y += samples[i].*value / count;
  }
  for (std::size_t i = first; i < samples.size(); ++i) {
    xx += (samples[i].hours - x) * (samples[i].hours - x);
    xy += (samples[i].hours - x) * (samples[i].*value - y);
  }
  return xx > 0.0 ? xy / xx : 0.0;
}

sim::Fleet OneRobot(std::uint64_t seed) {
  auto world = sim::OpenSurroundings("office");
  if (!world) throw std::runtime_error(world.error().message);
  sim::FleetOptions options;
  options.robots = 1;
  options.scan_hz = kScanRate_hz;
  options.laser.beams = 181;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(std::move(*world), options);
  if (!fleet) throw std::runtime_error(fleet.error().message);
  return std::move(*fleet);
}

// Everything there is to know of the server at this moment. The robot is between two scans.
Sample Look(const SoakedServer& server, FastRobot& robot) {
  Sample sample;
  const client::Percentiles latency_ms = robot.TakeLatencies();
  const Ledger ledger = robot.ledger();
  if (ledger.used + ledger.dropped_total() != robot.scans()) throw std::runtime_error("a scan is not accounted for");
  sample.hours = static_cast<double>(robot.scans()) / kScanRate_hz / 3600.0;
  sample.resident_mib = server.resident_mib();
  sample.disk_mib = server.disk_mib();
  sample.p50_ms = latency_ms.At(0.5);
  sample.p99_ms = latency_ms.At(0.99);
  sample.keyframes = static_cast<double>(ledger.keyframes);
  sample.restart_s = server.RestartSeconds();
  return sample;
}

using Advance = void (FastRobot::*)(double seconds);

std::vector<Sample> Soak(Report& report, const SoakedServer& server, FastRobot& robot, Advance advance, double hours,
                         double every_s) {
  std::vector<Sample> samples;
  const auto count = static_cast<int>(hours * 3600.0 / every_s + 0.5);
  for (int i = 0; i < count; ++i) {
    (robot.*advance)(every_s);
    samples.push_back(Look(server, robot));
    const Sample& now = samples.back();
    report.Progress(Number(now.hours, 2) + " h: " + Number(now.resident_mib, 1) + " MiB, disk " +
                    Number(now.disk_mib, 1) + " MiB, scan to pose " + Number(now.p50_ms, 2) + " and " +
                    Number(now.p99_ms, 2) + " ms, restart " + Number(now.restart_s, 2) + " s");
  }
  return samples;
}

void Print(Report& report, const std::string& name, const std::vector<Sample>& samples,
           const std::vector<Figure>& figures) {
  Table table({"figure", "first", "last", "per hour", "may grow per hour"});
  for (const Figure& figure : figures) {
    const double slope = SlopePerHour(samples, figure.value);
    const std::string what = std::string(figure.name) + " (" + figure.unit + ")";
    table.Add({what, Number(samples.front().*figure.value, figure.decimals),
               Number(samples.back().*figure.value, figure.decimals), Number(slope, figure.decimals),
               Number(figure.most_per_hour, figure.decimals)});
    report.Expect(slope <= figure.most_per_hour, name + ": " + what + " grows by " + Number(slope, 2) + " per hour");
    Plot plot{.title = name + ": " + figure.name, .x = {"time", "h"}, .y = {figure.name, figure.unit}};
    Series series{.label = figure.name};
    for (const Sample& sample : samples) {
      series.x.push_back(sample.hours);
      series.y.push_back(sample.*figure.value);
    }
    plot.series = {series};
    report.Add(plot, name + " " + figure.name);
  }
  report.Add(table, name);
}

void StudyTime(StudyContext& context) {
  Report& report = context.report;
  const SoakedServer server;
  const auto bus = test::MakeBus("soak");
  FastRobot robot(*bus, "robot", OneRobot(context.seed), kScanRate_hz);
  const double every_s = context.Pick(600.0, 60.0);
  if (context.Wants("driving") || context.Wants("standing")) {
    const double hours = context.hours > 0.0 ? context.hours : context.Pick(24.0, 0.3);
    report.Heading("A robot drives: 10 scans of 181 beams a second");
    const auto samples = Soak(report, server, robot, &FastRobot::Drive, hours, every_s);
    Print(report, "driving", samples,
          {{"memory", "MiB", &Sample::resident_mib, 120.0, 1},
           {"disk", "MiB", &Sample::disk_mib, 60.0, 1},
           {"scan to pose, median", "ms", &Sample::p50_ms, context.Pick(0.1, 5.0), 2},
           {"scan to pose, 99th percentile", "ms", &Sample::p99_ms, context.Pick(1.0, 50.0), 2},
           {"restart", "s", &Sample::restart_s, context.Pick(0.2, 4.0), 2},
           {"keyframes", "1", &Sample::keyframes, 1e9, 0}});
  }
  if (!context.Wants("standing")) return;
  report.Heading("The robot stands");
  const double hours = context.hours > 0.0 ? context.hours / 6.0 : context.Pick(4.0, 0.3);
  const auto samples = Soak(report, server, robot, &FastRobot::Stand, hours, every_s);
  Print(report, "standing", samples,
        {{"memory", "MiB", &Sample::resident_mib, 12.0, 1},
         {"disk", "MiB", &Sample::disk_mib, 60.0, 1},
         {"scan to pose, median", "ms", &Sample::p50_ms, context.Pick(0.1, 5.0), 2},
         {"scan to pose, 99th percentile", "ms", &Sample::p99_ms, context.Pick(1.0, 50.0), 2},
         {"restart", "s", &Sample::restart_s, context.Pick(0.2, 4.0), 2}});
}

void StudyIdle(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Sessions that do nothing");
  const SoakedServer server;
  const auto bus = test::MakeBus("idle");
  Table table({"sessions", "memory (MiB)", "per session (MiB)"});
  const double empty_mib = server.resident_mib();
  table.Add({"0", Number(empty_mib, 1), "-"});
  const auto add = [&](const std::string& what) {
    const double now_mib = server.resident_mib();
    table.Add({Count(kIdleSessions) + what, Number(now_mib, 1), Number((now_mib - empty_mib) / kIdleSessions, 2)});
  };
  std::vector<std::unique_ptr<FastRobot>> robots;
  for (int i = 0; i < kIdleSessions; ++i)
    robots.push_back(std::make_unique<FastRobot>(*bus, "idle" + std::to_string(i + 1), OneRobot(1), kScanRate_hz));
  add(", opened");
  for (const auto& robot : robots) {
    robot->Drive(1.0);
    static_cast<void>(robot->TakeLatencies());
  }
  add(", after 10 scans each");
  report.Add(table, "idle");
}

void StudySoak(StudyContext& context) {
  if (context.Wants("driving") || context.Wants("standing")) StudyTime(context);
  if (context.Wants("idle")) StudyIdle(context);
}

const Registration kSoak("soak", "a day of one robot: memory, disk, time to the pose and restart; idle sessions",
                         StudySoak);

}  // namespace
}  // namespace cairn::studies
