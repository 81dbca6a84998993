// cairn-study soak lets a robot drive for a day of simulated time, as fast as a cairnd takes its scans, and then stand
// for some hours: memory, disk, time from scan to pose, and the time that a restart would take, against time. What
// grows although the robot only stands is kept for nothing. Then it measures the memory of sessions that do nothing.
// --hours: of the drive (24); --only driving|standing|idle.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "client/sim/shipped_worlds.h"
#include "tests/loopback.h"
#include "tests/studies/soak/fast_robot.h"
#include "tests/studies/soak/soaked_server.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

constexpr double kScanRate_hz = 10.0;
constexpr double kWarmUp = 0.25;  // Share of a phase before the slopes: buffers grow to their sizes.
constexpr int kMemoryLooks = 12;  // In the time of a sample.
constexpr int kIdleSessions = 64;
// What may grow: for every scan its pose on the path (144 bytes in two places, until they are thinned) and its record
// in the journal. Keyframes grow in number only until those that show nothing new are retired, but a quick run ends
// before: 12,000 an hour, of 3.5 KiB each, and what a server takes once for its first robot.
constexpr double kMostMemory_mib_per_hour = 12.0;
constexpr double kMostAtFirst_mib_per_hour = 200.0;
constexpr double kMostStandingQuick_mib_per_hour = 20.0;
constexpr double kMostDisk_mib_per_hour = 150.0;
constexpr double kMostIdleMib = 2.0;  // Of a session.

struct Sample {
  double hours = 0.0;
  double resident_mib = 0.0;  // The least since the sample before: without what a checkpoint needs for a moment.
  double peak_mib = 0.0;      // The most.
  double disk_mib = 0.0;
  double p50_ms = 0.0;
  double p99_ms = 0.0;
  double cpu_ms = 0.0;  // Processor time of the server for each scan.
  double restart_s = 0.0;
  double checkpoint_mib = 0.0;  // What is written anew each time.
  double pieces_mib = 0.0;      // What is written once.
  double keyframes = 0.0;
  double dropped = 0.0;
};

// A figure of the samples, and how much it may grow in an hour.
struct Figure {
  const char* name;
  const char* unit;
  double Sample::*value;
  double most_per_hour;
  int decimals;
  bool depends_on_speed = false;
};

// What the robot does meanwhile.
struct Phase {
  const char* name;
  void (FastRobot::*advance)(double seconds);
  double hours;
  double most_mib_per_hour;  // That memory may grow.
};

// The median of the slopes between all pairs (Theil 1950, Sen 1968): single samples, such as those taken while a
// checkpoint is made, do not move it.
double SlopePerHour(const std::vector<Sample>& samples, double Sample::*value) {
  const auto first = static_cast<std::size_t>(kWarmUp * static_cast<double>(samples.size()));
  std::vector<double> slopes;
  for (std::size_t i = first; i < samples.size(); ++i) {
    for (std::size_t j = i + 1; j < samples.size(); ++j)
      slopes.push_back((samples[j].*value - samples[i].*value) / (samples[j].hours - samples[i].hours));
  }
  return DistributionOf(std::move(slopes)).median;
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
Sample Look(const SoakedServer& server, FastRobot& robot, Sample sample) {
  const Distribution latency_ms = robot.TakeLatencies();
  const Ledger ledger = robot.ledger();
  if (ledger.used + ledger.dropped_total() != robot.scans()) throw std::runtime_error("a scan is not accounted for");
  sample.hours = static_cast<double>(robot.scans()) / kScanRate_hz / 3600.0;
  sample.disk_mib = server.disk_mib();
  sample.p50_ms = latency_ms.median;
  sample.p99_ms = latency_ms.p99;
  sample.keyframes = static_cast<double>(ledger.keyframes);
  sample.dropped = static_cast<double>(ledger.dropped_total());
  const SoakedServer::Restart restart = server.RestartOnCopy();
  sample.restart_s = restart.seconds;
  sample.checkpoint_mib = restart.checkpoint_mib;
  sample.pieces_mib = restart.pieces_mib;
  return sample;
}

std::vector<Sample> Watch(const StudyContext& context, const Phase& phase, const SoakedServer& server,
                          FastRobot& robot) {
  const double every_s = context.Pick(600.0, 180.0);
  const auto count = static_cast<int>((context.hours > 0.0 ? context.hours : phase.hours) * 3600.0 / every_s + 0.5);
  std::vector<Sample> samples;
  for (int i = 0; i < count; ++i) {
    Sample since{.resident_mib = std::numeric_limits<double>::infinity()};
    const double cpu_s = server.cpu_s();
    const auto scans = static_cast<double>(robot.scans());
    for (int part = 0; part < kMemoryLooks; ++part) {
      (robot.*phase.advance)(every_s / kMemoryLooks);
      since.resident_mib = std::min(since.resident_mib, server.resident_mib());
      since.peak_mib = std::max(since.peak_mib, server.resident_mib());
    }
    since.cpu_ms = 1e3 * (server.cpu_s() - cpu_s) / (static_cast<double>(robot.scans()) - scans);
    samples.push_back(Look(server, robot, since));
    const Sample& now = samples.back();
    context.report.Progress(Number(now.hours, 2) + " h: " + Number(now.resident_mib, 1) + " to " +
                            Number(now.peak_mib, 1) + " MiB, disk " + Number(now.disk_mib, 1) + " MiB, checkpoint " +
                            Number(now.checkpoint_mib, 1) + " + " + Number(now.pieces_mib, 1) +
                            " MiB, scan to pose p50 " + Number(now.p50_ms, 2) + " ms, p99 " + Number(now.p99_ms, 2) +
                            " ms, processor " + Number(now.cpu_ms, 2) + " ms, restart " + Number(now.restart_s, 2) +
                            " s");
  }
  return samples;
}

void Draw(Report& report, const std::string& phase, const Figure& figure, const std::vector<Sample>& samples) {
  Plot plot{.title = phase + ": " + figure.name, .x = {"time", "h"}, .y = {figure.name, figure.unit}};
  Series series;
  for (const Sample& sample : samples) {
    series.x.push_back(sample.hours);
    series.y.push_back(sample.*figure.value);
  }
  plot.series = {series};
  report.Add(plot, phase + " " + figure.name);
}

void Soak(StudyContext& context, const Phase& phase, const SoakedServer& server, FastRobot& robot) {
  const std::vector<Sample> samples = Watch(context, phase, server, robot);
  const std::vector<Figure> figures = {
      {"memory", "MiB", &Sample::resident_mib, phase.most_mib_per_hour, 1},
      {"peak of memory", "MiB", &Sample::peak_mib, 5.0 * phase.most_mib_per_hour, 1},
      {"disk", "MiB", &Sample::disk_mib, kMostDisk_mib_per_hour, 1},
      {"checkpoint", "MiB", &Sample::checkpoint_mib, kMostDisk_mib_per_hour, 1},
      {"pieces of the checkpoint", "MiB", &Sample::pieces_mib, kMostDisk_mib_per_hour, 1},
      {"latency p50", "ms", &Sample::p50_ms, 0.1, 2, true},
      {"latency p99", "ms", &Sample::p99_ms, 1.0, 2, true},
      {"processor time of a scan", "ms", &Sample::cpu_ms, 0.1, 2, true},
      {"restart", "s", &Sample::restart_s, 0.5, 2, true},
      {"dropped scans", "1", &Sample::dropped, 0.0, 0},
  };
  Report& report = context.report;
  Table table({"figure", "first", "last", "per hour", "may grow per hour"});
  for (const Figure& figure : figures) {
    const double slope = SlopePerHour(samples, figure.value);
    const std::string what = std::string(figure.name) + " (" + figure.unit + ")";
    table.Add({what, Number(samples.front().*figure.value, figure.decimals),
               Number(samples.back().*figure.value, figure.decimals), Number(slope, figure.decimals),
               Number(figure.most_per_hour, figure.decimals)});
    // A quick run is a test beside other tests: the slope of a time over its few minutes says how busy the machine is.
    if (!context.quick || !figure.depends_on_speed) {
      report.Expect(slope <= figure.most_per_hour,
                    phase.name + (": " + what) + " grows by " + Number(slope, 2) + " in an hour");
    }
    Draw(report, phase.name, figure, samples);
  }
  report.Add(table, phase.name);
  report.Text(Count(std::llround(SlopePerHour(samples, &Sample::keyframes))) + " keyframes an hour.");
}

void StudyTime(StudyContext& context) {
  const SoakedServer server;
  const auto bus = test::MakeBus("soak");
  FastRobot robot(*bus, "robot", OneRobot(context.seed), kScanRate_hz);
  if (context.Wants("driving")) {
    context.report.Heading("A robot drives: 10 scans of 181 beams a second");
    Soak(context,
         {"driving", &FastRobot::Drive, context.Pick(24.0, 0.25),
          context.Pick(kMostMemory_mib_per_hour, kMostAtFirst_mib_per_hour)},
         server, robot);
  } else {
    robot.Drive(60.0);
  }
  if (context.Wants("standing")) {
    context.report.Heading("The robot stands");
    Soak(context,
         {"standing", &FastRobot::Stand, context.Pick(4.0, 0.5),
          context.Pick(kMostMemory_mib_per_hour, kMostStandingQuick_mib_per_hour)},
         server, robot);
  }
}

// Each robot leaves before the next one comes: what a session keeps is the same. 64 clients in one process would answer
// each heartbeat of the server 64 times.
void StudyIdle(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Sessions that do nothing: 10 scans each, then the robot is away");
  const SoakedServer server;
  const auto bus = test::MakeBus("idle");
  Table table({"sessions", "memory (MiB)", "per session (MiB)"});
  const double empty_mib = server.resident_mib();
  table.Add({"0", Number(empty_mib, 1), "-"});
  for (int i = 1; i <= kIdleSessions; ++i) {
    FastRobot robot(*bus, "idle" + std::to_string(i), OneRobot(1), kScanRate_hz);
    robot.Drive(1.0);
    static_cast<void>(robot.TakeLatencies());
    const double now_mib = server.resident_mib();
    if (i == 1 || i % 16 == 0) table.Add({Count(i), Number(now_mib, 1), Number((now_mib - empty_mib) / i, 2)});
  }
  const double each_mib = (server.resident_mib() - empty_mib) / kIdleSessions;
  report.Expect(each_mib <= kMostIdleMib, "a session that does nothing keeps " + Number(each_mib, 2) +
                                              " MiB; at most " + Number(kMostIdleMib, 0));
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
