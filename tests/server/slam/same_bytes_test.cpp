// The same log, options and seed give the same trajectory byte for byte, whichever compiler built the program
// and however it optimised: hashes of trajectories are written down here, and every build (gcc -O3, clang -O1
// with sanitizers) must arrive at them. A change that is meant to alter the default's numbers writes new
// hashes: each failure prints what it found. Sine, logarithm and their like come from the C library, which
// rounds them one way on processors with fused multiply-add and another way on those without. So hashes are
// written down by what the library answers; on a machine whose library answers otherwise the tests print what
// a row for it needs, and are skipped.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/sensor/log_reader.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/real_logs.h"
#include "tests/server/slam/simulated_drive.h"

namespace cairn::slam {
namespace {

// FNV-1a over the bits of numbers.
class Hash {
 public:
  void Add(std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte) value_ = (value_ ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3;
  }
  void Add(double value) { Add(std::bit_cast<std::uint64_t>(value)); }
  void Add(const Pose2& pose) { Add(pose.x), Add(pose.y), Add(pose.theta); }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325;
};

std::uint64_t MathLibrary() {
  Hash hash;
  for (int i = 1; i <= 3000; ++i) {
    const double x = 0.0123456789 * i;
    for (const double value : {std::sin(x), std::cos(x), std::atan2(x - 17.0, 3.0 - 0.001 * i), std::exp(-0.1 * x),
                               std::log(x), std::hypot(x, 2.0)})
      hash.Add(value);
  }
  return hash.value();
}

// The expected hashes for one mathematical library.
struct Expected {
  std::uint64_t math_library;
  std::uint64_t world;      // Scans and odometry of the simulated drive,
  std::uint64_t drive;      // its trajectory and the smoothed one,
  std::uint64_t particles;  // and with DP-SLAM, which draws more random numbers than any other filter.
  std::uint64_t csail;      // The trajectory of mit-csail and the smoothed one.
};
constexpr Expected kExpected[] = {
    // glibc 2.36 on x86-64 with fused multiply-add,
    {0x9e5d14321c7acacd, 0x2fef4b534be74485, 0x6b705ed086f2a3bf, 0xe3c5d570a1b76b76, 0xc1c1e350b06bd53d},
    // and without it (GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA,-AVX2,-FMA4,-AVX2_Usable,-FMA_Usable).
    {0x70be98054093c91d, 0x2fef4b534be74485, 0x8e27d47174e258dd, 0xe3c5d570a1b76b76, 0x201222bd46977958},
};

void Check(const char* what, std::uint64_t Expected::*member, std::uint64_t found) {
  const std::uint64_t library = MathLibrary();
  const auto* expected = std::ranges::find(kExpected, library, &Expected::math_library);
  const bool known = expected != std::end(kExpected);
  if (known && expected->*member == found) return;
  std::printf("%s: 0x%016llx, of the mathematical library 0x%016llx\n", what, static_cast<unsigned long long>(found),
              static_cast<unsigned long long>(library));
  if (!known) GTEST_SKIP() << "SKIPPED: nothing is written down for this machine's mathematical library";
  FAIL() << what << " differs from what is written down";
}

class Estimate {
 public:
  Estimate(const MapperOptions& options, const Pose2& T_map_robot_start)
      : pipeline_(options, T_map_robot_start, SerialFor,
                  {.used =
                       [this](const Scan& scan, const ScanOutcome& outcome) {
                         online_.Add(static_cast<std::uint64_t>(scan.stamp));
                         online_.Add(outcome.T_map_robot);
                       },
                   .dropped = [](const Scan&, DropReason) {}}) {}
  void Take(const LogRecord& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (ValidateOdometry(*odometry)) pipeline_.Add(*odometry);
    } else if (auto scan = std::make_shared<const Scan>(std::get<Scan>(record)); ValidateScan(*scan)) {
      pipeline_.Add(std::move(scan));
    }
  }
  // The hash of the trajectory so far.
  // The hash of the trajectory and of the smoothed path.
  [[nodiscard]] std::uint64_t Finish() {
    pipeline_.Finish();
    Hash hash = online_;
    for (const Pose2& pose : SmoothedPath(pipeline_.mapper().Snapshot())) hash.Add(pose);
    return hash.value();
  }

 private:
  Hash online_;
  ScanPipeline pipeline_;
};

std::uint64_t Driven(const MapperOptions& options, const test::Drive& drive) {
  Estimate estimate(options, drive.T_map_robot_start);
  for (const LogRecord& record : drive.records) estimate.Take(record);
  return estimate.Finish();
}

TEST(SameBytes, OfASimulatedWorld) {
  Hash hash;
  for (const LogRecord& record : test::SimulatedDrive(60.0).records) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      hash.Add(odometry->T_odom_robot);
    } else {
      for (const float range : std::get<Scan>(record).ranges_m) hash.Add(static_cast<double>(range));
    }
  }
  Check("world", &Expected::world, hash.value());
}

TEST(SameBytes, OfASimulatedDrive) {
  Check("drive", &Expected::drive, Driven({}, test::SimulatedDrive(60.0)));
}

TEST(SameBytes, OfParticlesWithMaps) {
  MapperOptions options;
  options.filter.kind = FilterKind::kDpSlam;
  options.filter.particles = 15;
  options.filter.dpslam.segment.length_m = 3.0;
  Check("particles", &Expected::particles, Driven(options, test::SimulatedDrive(20.0)));
}

TEST(SameBytes, OfARealLog) {
  CAIRN_NEED_LOG(log, "mit-csail.clf");
  Estimate estimate({}, {});
  ASSERT_TRUE(ReadLog(log, {}, [&](LogRecord&& record) {
    estimate.Take(record);
    return true;
  }));
  Check("csail", &Expected::csail, estimate.Finish());
}

}  // namespace
}  // namespace cairn::slam
