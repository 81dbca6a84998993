// An estimator that is stopped, saved, loaded into a fresh one and goes on gives the same bytes as one that was never
// stopped; and no bytes, however damaged, do harm.
#include "server/slam/checkpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/file/checksum.h"
#include "common/sensor/log_reader.h"
#include "server/slam/localisation/keyframe_lines.h"
#include "server/slam/scan_pipeline.h"
#include "tests/real_logs.h"
#include "tests/server/slam/simulated_drive.h"

namespace cairn::slam {
namespace {

#ifdef NDEBUG
constexpr bool kFast = true;
#else
constexpr bool kFast = false;
#endif

using test::Drive;

Drive Csail(const std::filesystem::path& log, int scans) {
  Drive drive;
  const auto read = ReadLog(log, {}, [&](LogRecord&& record) {
    scans -= std::holds_alternative<Scan>(record) ? 1 : 0;
    drive.records.push_back(std::move(record));
    return scans > 0;
  });
  EXPECT_TRUE(read);
  return drive;
}

// What an estimator gave, and the state in which it ended.
struct Course {
  std::vector<ScanOutcome> outcomes;
  std::string state;

  [[nodiscard]] ScanPipeline::Sink sink() {
    return {.used = [this](const Scan&, const ScanOutcome& outcome) { outcomes.push_back(outcome); },
            .dropped = [](const Scan&, DropReason) {}};
  }
};

ScanPipeline::Sink Ignoring() {
  return {.used = [](const Scan&, const ScanOutcome&) {}, .dropped = [](const Scan&, DropReason) {}};
}

void Add(ScanPipeline& pipeline, const LogRecord& record) {
  if (const auto* odometry = std::get_if<Odometry>(&record)) {
    if (ValidateOdometry(*odometry)) pipeline.Add(*odometry);
  } else if (auto scan = std::make_shared<const Scan>(std::get<Scan>(record)); ValidateScan(*scan)) {
    pipeline.Add(std::move(scan));
  }
}

// With `stop_every` > 0 the estimator is saved after so many scans each time, and another one goes on.
Course Run(const Drive& drive, const MapperOptions& options, int stop_every) {
  Course course;
  auto pipeline = std::make_unique<ScanPipeline>(options, drive.T_map_robot_start, SerialFor, course.sink());
  int scans = 0;
  for (const LogRecord& record : drive.records) {
    Add(*pipeline, record);
    if (!std::holds_alternative<Scan>(record) || stop_every == 0 || ++scans % stop_every != 0) continue;
    std::string bytes;
    pipeline->Save(bytes);
    pipeline = std::make_unique<ScanPipeline>(options, Pose2{}, SerialFor, course.sink());
    const Result<void> loaded = pipeline->Load(bytes);
    if (!loaded) {
      ADD_FAILURE() << "after " << scans << " scans: " << loaded.error().message;
      return course;
    }
  }
  pipeline->Finish();
  pipeline->Save(course.state);
  return course;
}

// The state holds everything: the path, the map, the particles, the random engines.
void ExpectNothingChangedByStopping(const Drive& drive, const MapperOptions& options) {
  const Course whole = Run(drive, options, 0), stopped = Run(drive, options, 10);
  EXPECT_GT(std::ranges::count(whole.outcomes, true, &ScanOutcome::keyframe), 10);
  ASSERT_EQ(whole.outcomes.size(), stopped.outcomes.size());
  for (std::size_t i = 0; i < whole.outcomes.size(); ++i) {
    ASSERT_EQ(whole.outcomes[i].T_map_robot, stopped.outcomes[i].T_map_robot) << "scan " << i;
    ASSERT_EQ(whole.outcomes[i].covariance, stopped.outcomes[i].covariance) << "scan " << i;
    ASSERT_EQ(whole.outcomes[i].reason, stopped.outcomes[i].reason) << "scan " << i;
  }
  EXPECT_TRUE(whole.state == stopped.state);
}

MapperOptions With(FilterKind kind) {
  MapperOptions options;
  options.filter.kind = kind;
  options.filter.particles = 30;
  return options;
}

MapperOptions WithGrids(bool hierarchical, HighLevelKind high_level) {
  MapperOptions options = With(FilterKind::kDpSlam);
  options.filter.particles = 15;
  options.filter.dpslam.hierarchical = hierarchical;
  options.filter.dpslam.high_level = high_level;
  options.filter.dpslam.segment.length_m = 3.0;
  options.filter.dpslam.segment.keep_m = 4.0;
  options.filter.dpslam.segment.trajectories = 2;
  options.filter.dpslam.opacity.max_ray_m = 6.0;
  return options;
}

MapperOptions WithMatcher(MatcherKind kind) {
  MapperOptions options = With(FilterKind::kFastSlam2Points);
  options.matcher = kind;
  options.front_end.refine_enabled = false;
  return options;
}

MapperOptions WithoutOdometry() {
  MapperOptions options = With(FilterKind::kFastSlam2Points);
  options.front_end.use_odometry = false;
  return options;
}

// A known map: the walls that this drive sees.
MapperOptions WithMapOf(const Drive& drive) {
  MapperOptions options = With(FilterKind::kLineMatch);
  ScanPipeline pipeline(With(FilterKind::kNone), drive.T_map_robot_start, SerialFor, Ignoring());
  for (const LogRecord& record : drive.records) Add(pipeline, record);
  const MapperSnapshot snapshot = pipeline.mapper().Snapshot();
  options.filter.line_match.map =
      std::make_shared<const std::vector<MapLine>>(LinesOfKeyframes(snapshot.keyframes, snapshot.full_path));
  return options;
}

struct Case {
  std::string name;
  std::function<MapperOptions(const Drive&)> options;
  double seconds = 60.0;
};

const Case kCases[] = {
    {"FastSlam2Points", [](const Drive&) { return With(FilterKind::kFastSlam2Points); }, 120.0},
    {"FastSlam2Oriented", [](const Drive&) { return With(FilterKind::kFastSlam2Oriented); }},
    {"FastSlam1", [](const Drive&) { return With(FilterKind::kFastSlam1); }},
    {"Ekf", [](const Drive&) { return With(FilterKind::kEkf); }},
    {"DpSlamFlat", [](const Drive&) { return WithGrids(false, HighLevelKind::kMoving); }, 30.0},
    {"DpSlamMoving", [](const Drive&) { return WithGrids(true, HighLevelKind::kMoving); }},
    {"DpSlamPlain", [](const Drive&) { return WithGrids(true, HighLevelKind::kPlain); }, 30.0},
    {"LandmarkCorrection", [](const Drive&) { return With(FilterKind::kLandmarkCorrection); }},
    {"None", [](const Drive&) { return With(FilterKind::kNone); }},
    {"LineMatch", WithMapOf},
    {"IcpAlone", [](const Drive&) { return WithMatcher(MatcherKind::kIcp); }},
    {"WithoutOdometry", [](const Drive&) { return WithoutOdometry(); }},
};

class Checkpoints : public testing::TestWithParam<Case> {};

TEST_P(Checkpoints, StoppingChangesNothing) {
  const Drive drive = test::SimulatedDrive(kFast ? GetParam().seconds : 15.0);
  ExpectNothingChangedByStopping(drive, GetParam().options(drive));
}

TEST_P(Checkpoints, StoppingChangesNothingOnARealLog) {
  CAIRN_NEED_LOG(log, "mit-csail.clf");
  const Drive drive = Csail(log, kFast ? 200 : 60);
  ExpectNothingChangedByStopping(drive, GetParam().options(drive));
}

// The bytes with one byte replaced. Half of the places are in the main part, which holds every index and size; the rest
// is mostly scans and parts of the map.
template <typename Try>
void Damage(const std::string& bytes, int times, const Try& try_one) {
  std::mt19937_64 rng(7);
  std::uint64_t main = 0;
  std::memcpy(&main, bytes.data(), sizeof(main));
  std::string damaged = bytes;
  for (int i = 0; i < times; ++i) {
    const std::size_t at = rng() % (i % 2 == 0 ? sizeof(main) + main : bytes.size());
    damaged[at] = static_cast<char>(bytes[at] ^ static_cast<char>(1 + rng() % 255));
    try_one(damaged);
    damaged[at] = bytes[at];
  }
}

// The checksum finds accidents. A stranger can write a right one, so the state itself is read with care, too: what is
// read either is refused or can be gone on from.
TEST_P(Checkpoints, ADamagedStateIsRefusedOrHarmless) {
  const Drive drive = test::SimulatedDrive(kFast ? 20.0 : 10.0);
  const MapperOptions options = GetParam().options(drive);
  ScanPipeline pipeline(options, drive.T_map_robot_start, SerialFor, Ignoring());
  for (const LogRecord& record : drive.records) Add(pipeline, record);
  StateWriter archive;
  pipeline.mapper().Save(archive);
  int refused = 0;
  const auto try_one = [&](std::string_view bytes) {
    StateReader reader(bytes);
    Mapper mapper(options, {}, 1);
    mapper.Load(reader);
    refused += reader.ok() ? 0 : 1;
    Stamp stamp = 0;
    for (std::size_t i = drive.records.size() - 12; i < drive.records.size(); ++i)
      if (const auto* scan = std::get_if<Scan>(&drive.records[i])) {
        auto later = std::make_shared<Scan>(*scan);
        later->stamp = stamp += kNanosPerSecond;
        (void)mapper.Process(later, {0.3 * SecondsFromStamp(stamp), 0, 0}, SerialFor);
      }
  };
  const std::string bytes = archive.Bytes();
  Damage(bytes, kFast ? 200 : 60, try_one);
  // With fewer bytes damaged, each may be a number that can be anything.
  EXPECT_GE(refused, kFast ? 1 : 0);
  for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 50) {
    refused = 0;
    try_one(std::string_view(bytes).substr(0, size));
    EXPECT_EQ(refused, 1) << size;
  }
  // A main part that ends too early, with its right length: what comes before the end is read.
  std::uint64_t main = 0;
  std::memcpy(&main, bytes.data(), sizeof(main));
  for (std::uint64_t size = 0; size < main; size += 1 + main / (kFast ? 500 : 100)) {
    refused = 0;
    try_one(std::string(reinterpret_cast<const char*>(&size), sizeof(size)) + bytes.substr(sizeof(main), size) +
            bytes.substr(sizeof(main) + main));
    EXPECT_EQ(refused, 1) << size;
  }
}

INSTANTIATE_TEST_SUITE_P(EveryFilter, Checkpoints, testing::ValuesIn(kCases),
                         [](const auto& tested) { return tested.param.name; });

struct Saved {
  Saved() {
    for (const LogRecord& record : drive.records) Add(pipeline, record);
    pipeline.Save(bytes);
  }
  Drive drive = test::SimulatedDrive(10.0);
  MapperOptions options = With(FilterKind::kFastSlam2Points);
  Course course;
  ScanPipeline pipeline{options, drive.T_map_robot_start, SerialFor, course.sink()};
  std::string bytes;
};

TEST(Checkpoint, DamagedBytesAreRefusedAndChangeNothing) {
  Saved saved;
  const auto refused = [&](std::string_view bytes) {
    const Result<void> loaded = saved.pipeline.Load(bytes);
    return !loaded && !loaded.error().message.empty();
  };
  std::string damaged = saved.bytes;
  for (std::size_t at = 0; at < damaged.size(); at += at < 2000 ? 1 : 997) {
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    ASSERT_TRUE(refused(damaged)) << "byte " << at;
    damaged[at] = saved.bytes[at];
  }
  for (std::size_t size = 0; size < damaged.size(); size += size < 200 ? 1 : 4999)
    ASSERT_TRUE(refused(std::string_view(damaged).substr(0, size))) << "length " << size;
  ASSERT_TRUE(refused(damaged + '\0'));
  std::string after;
  saved.pipeline.Save(after);
  EXPECT_TRUE(after == saved.bytes);
}

TEST(Checkpoint, OfOtherOptionsIsRefusedByName) {
  Saved saved;
  MapperOptions options = saved.options;
  options.filter.particles = 31;
  ScanPipeline other(options, {}, SerialFor, Ignoring());
  const Result<void> loaded = other.Load(saved.bytes);
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, StatusCode::kFailedPrecondition);
  EXPECT_NE(loaded.error().message.find("'slam.particles 30', here 'slam.particles 31'"), std::string::npos)
      << loaded.error().message;
}

TEST(Checkpoint, OfAnotherKnownMapIsRefused) {
  const Drive drive = test::SimulatedDrive(10.0);
  MapperOptions options = WithMapOf(drive);
  std::string bytes;
  ScanPipeline(options, {}, SerialFor, Ignoring()).Save(bytes);
  EXPECT_TRUE(ScanPipeline(options, {}, SerialFor, Ignoring()).Load(bytes));
  std::vector<MapLine> other = *options.filter.line_match.map;
  other.front().a.x() += 0.1;
  options.filter.line_match.map = std::make_shared<const std::vector<MapLine>>(std::move(other));
  const Result<void> loaded = ScanPipeline(options, {}, SerialFor, Ignoring()).Load(bytes);
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.error().message.find("slam.line_match.map with the checksum"), std::string::npos)
      << loaded.error().message;
}

// The bytes with another text of options.
std::string WithOptions(const std::string& bytes, const std::function<void(std::string&)>& change) {
  constexpr std::size_t kChecksumAt = 12, kLengthAt = 20, kTextAt = 28;
  std::uint64_t length = 0;
  std::memcpy(&length, bytes.data() + kLengthAt, sizeof(length));
  std::string text = bytes.substr(kTextAt, length);
  change(text);
  std::string checked(sizeof(length), '\0');
  const std::uint64_t new_length = text.size();
  std::memcpy(checked.data(), &new_length, sizeof(new_length));
  checked += text + bytes.substr(kTextAt + length);
  std::string changed = bytes.substr(0, kLengthAt) + checked;
  const std::uint64_t checksum = ChecksumOf(checked);
  std::memcpy(changed.data() + kChecksumAt, &checksum, sizeof(checksum));
  return changed;
}

void RemoveLine(std::string& text, const std::string& key) {
  const auto at = ('\n' + text).find('\n' + key + ' ');
  ASSERT_NE(at, std::string::npos);
  text.erase(at, text.find('\n', at) + 1 - at);
}

// A program that is newer than the checkpoint has options more, or some less.
TEST(Checkpoint, AnOptionThatIsNotInItHasItsDefault) {
  Saved saved;
  const std::string without_gate =
      WithOptions(saved.bytes, [](std::string& text) { RemoveLine(text, "slam.gate.distance_m"); });
  EXPECT_TRUE(saved.pipeline.Load(without_gate));
  MapperOptions options = saved.options;
  options.gate.distance_m *= 2.0;
  ScanPipeline other(options, {}, SerialFor, Ignoring());
  const Result<void> loaded = other.Load(without_gate);
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.error().message.find("slam.gate.distance_m"), std::string::npos) << loaded.error().message;
}

TEST(Checkpoint, AnOptionThatIsGoneDoesNotCount) {
  Saved saved;
  EXPECT_TRUE(saved.pipeline.Load(WithOptions(saved.bytes, [](std::string& text) { text += "slam.old_option 7\n"; })));
}

TEST(Checkpoint, TellsTheOptionsWithWhichItWasMade) {
  Saved saved;
  MapperOptions here;
  here.filter.particles = 31;
  const auto options = OptionsOf(saved.bytes, here);
  ASSERT_TRUE(options) << options.error().message;
  EXPECT_EQ(options->filter.particles, 30);
  ScanPipeline other(*options, {}, SerialFor, Ignoring());
  EXPECT_TRUE(other.Load(saved.bytes));
}

TEST(Checkpoint, OptionsThatCanNotBeAreRefused) {
  Saved saved;
  for (const auto& [key, value] : {std::pair("slam.particles", "many"),
                                   {"slam.particles", "-1"},
                                   {"slam.filter", "magic"},
                                   {"slam.loop.enabled", "perhaps"},
                                   {"slam.grid.resolution_m", "nan"}}) {
    const auto options = OptionsOf(WithOptions(saved.bytes,
                                               [&key = key, &value = value](std::string& text) {
                                                 RemoveLine(text, key);
                                                 text += std::string(key) + ' ' + value + '\n';
                                               }),
                                   saved.options);
    ASSERT_FALSE(options) << key << ' ' << value;
    EXPECT_EQ(options.error().code, StatusCode::kDataLoss);
    EXPECT_NE(options.error().message.find(key), std::string::npos) << options.error().message;
  }
  EXPECT_FALSE(OptionsOf("CAIRN", saved.options));
}

TEST(Checkpoint, OfANewerFormatIsRefused) {
  Saved saved;
  saved.bytes[8] = static_cast<char>(kCheckpointFormat + 1);
  const Result<void> loaded = saved.pipeline.Load(saved.bytes);
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, StatusCode::kUnimplemented);
}

// What the checkpoint shares with the estimator never changes.
TEST(Checkpoint, IsOfTheMomentWhenItWasTaken) {
  Saved saved;
  const Checkpoint checkpoint = saved.pipeline.Save();
  const auto more = test::SimulatedDrive(20.0).records;
  for (std::size_t i = saved.drive.records.size(); i < more.size(); ++i) Add(saved.pipeline, more[i]);
  (void)saved.pipeline.mapper().TakeGridChange();
  std::string later;
  saved.pipeline.Save(later);
  EXPECT_FALSE(later == saved.bytes);
  EXPECT_TRUE(checkpoint.Bytes() == saved.bytes);
}

}  // namespace
}  // namespace cairn::slam
