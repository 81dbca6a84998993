// Checkpoints whose checksum is right, which a stranger can make: a number, the state of a session's account, and the
// state of an estimator. The number chooses the estimator's method, or a whole server that starts on the checkpoint.
// What is loaded takes scans, draws, and can be saved and loaded again.
#include <array>
#include <cmath>
#include <cstring>
#include <span>

#include "common/file/checksum.h"
#include "server/robots/session_record.h"
#include "server/slam/checkpoint.h"
#include "server/slam/scan_pipeline.h"
#include "server/store/checkpoint_writer.h"
#include "tests/fuzz/restored_rooms.h"
#include "tests/fuzz/stored_samples.h"

namespace cairn::fuzz {
namespace {

using slam::FilterKind;
using slam::MapperOptions;
using slam::ScanPipeline;

constexpr std::array kFilters = {FilterKind::kFastSlam2Points,
                                 FilterKind::kFastSlam2Oriented,
                                 FilterKind::kFastSlam1,
                                 FilterKind::kEkf,
                                 FilterKind::kDpSlam,
                                 FilterKind::kDpSlam,
                                 FilterKind::kLandmarkCorrection,
                                 FilterKind::kNone};
constexpr std::size_t kServer = kFilters.size();  // This number stands for a whole server.
constexpr std::size_t kMostBytes = std::size_t{1} << 18;
// What an input may make the estimator hold.
constexpr std::size_t kMostKeyframes = 64;

MapperOptions OptionsOf(std::size_t kind) {
  MapperOptions options = TinyEstimator();
  options.front_end.refine_enabled = false;
  options.filter.kind = kFilters[kind];
  options.filter.dpslam.hierarchical = kind == 4;
  options.filter.dpslam.segment.length_m = 3.0;
  options.filter.dpslam.segment.keep_m = 4.0;
  options.filter.dpslam.segment.trajectories = 2;
  options.filter.dpslam.opacity.max_ray_m = 4.0;
  return options;
}

constexpr std::size_t kChecksumAt = 12, kOptionsAt = 20;

// The checkpoint with this state, and the right options and checksum.
std::string WithState(const MapperOptions& options, std::string_view state) {
  std::string bytes = slam::Checkpoint(options, {}).Bytes();
  bytes.resize(bytes.size() - sizeof(std::uint64_t));  // The empty state.
  bytes += state;
  const std::uint64_t sum = ChecksumOf(std::string_view(bytes).substr(kOptionsAt));
  std::memcpy(bytes.data() + kChecksumAt, &sum, sizeof(sum));
  return bytes;
}

std::string StateOf(const std::string& checkpoint) {
  std::uint64_t length = 0;
  std::memcpy(&length, checkpoint.data() + kOptionsAt, sizeof(length));
  return checkpoint.substr(kOptionsAt + sizeof(length) + length);
}

ScanPipeline::Sink Checking() {
  return {.used =
              [](const Scan&, const slam::ScanOutcome& outcome) {
                Must(outcome.T_map_robot.IsFinite() && std::isfinite(outcome.score), "an estimate is finite");
              },
          .dropped = [](const Scan&, DropReason) {}};
}

void DriveOn(ScanPipeline& pipeline, int first, int last) {
  for (int step = first; step < last; ++step) {
    pipeline.Add(server::testing::RoomOdometry(step));
    pipeline.Add(std::make_shared<const Scan>(SmallScan(step)));
  }
}

bool RunEstimator(std::size_t kind, std::string_view state) {
  const MapperOptions options = OptionsOf(kind);
  ScanPipeline pipeline(options, {}, slam::SerialFor, Checking());
  const Result<void> loaded = pipeline.Load(WithState(options, state));
  if (!loaded) {
    Must(loaded.error().code == StatusCode::kDataLoss && !loaded.error().message.empty(), "a refusal has a reason");
    return false;
  }
  std::string saved;
  pipeline.Save(saved);
  ScanPipeline other(options, {}, slam::SerialFor, Checking());
  Must(other.Load(saved).has_value(), "what was loaded can be saved and loaded again");
  std::string again;
  other.Save(again);
  Must(again == saved, "it is saved as the same bytes");
  if (pipeline.mapper().keyframe_count() > kMostKeyframes) return true;
  DriveOn(pipeline, 8, 11);
  static_cast<void>(pipeline.mapper().Snapshot());
  static_cast<void>(pipeline.mapper().landmarks());
  static_cast<void>(pipeline.mapper().TakeGridChange());
  pipeline.Finish();
  return true;
}

// As SessionEstimator::Save joins the two parts.
std::string Joined(std::string_view account, std::string_view estimator) {
  const std::uint64_t size = account.size();
  std::string number(sizeof(size), '\0');
  const std::string no_pieces = number;
  std::memcpy(number.data(), &size, sizeof(size));
  return number.append(account).append(no_pieces).append(estimator);
}

bool RunServer(std::string_view account, std::string_view state) {
  MemoryStore store;
  store.Put({server::RecordKind::kSession, 5, 0}, BytesOf(server::testing::SampleSession(5)));
  server::CheckpointWriter writer(5, 3, {Joined(account, WithState(TinyEstimator(), state))});
  while (!writer.complete()) {
    server::RecordChanges changes;
    writer.AddTo(changes);
    static_cast<void>(store.Commit(changes));
  }
  return StartOn(store) == Restored::kSessions;
}

bool RunCheckpoint(std::string_view input) {
  if (input.size() > kMostBytes) return false;
  Pieces pieces(input);
  const std::size_t kind = pieces.Take() % (kFilters.size() + 1);
  if (kind == kServer) {
    const std::string_view account = pieces.TakePiece();
    return RunServer(account, pieces.rest());
  }
  return RunEstimator(kind, pieces.rest());
}

std::string SeedOf(std::size_t kind, int scans) {
  const MapperOptions options = OptionsOf(kind);
  ScanPipeline pipeline(options, kStart, slam::SerialFor, Checking());
  DriveOn(pipeline, 0, scans);
  std::string saved;
  pipeline.Save(saved);
  return std::string(1, static_cast<char>(kind)) + StateOf(saved);
}

// What a server that was given the drive stores as the account of its session.
std::string SeedOfServer(int scans) {
  const auto options = TinyEstimator();
  ScanPipeline pipeline(options, kStart, slam::SerialFor, Checking());
  DriveOn(pipeline, 0, scans);
  std::string saved;
  pipeline.Save(saved);
  const SessionRequest request = server::testing::SampleSession(5).request;
  const StreamId stream{HashName(request.robot), HashName("laser"), request.session};
  server::SessionRecord record(5, request, {});
  slam::StateWriter writer;
  Must(record.AddSensors({"laser"}), "a session with a sensor");
  for (std::uint64_t sequence = 1; sequence <= 2; ++sequence) {
    static_cast<void>(record.ScanReceived(stream, sequence));
    PoseReport pose;
    pose.scan_sequence = sequence;
    record.ScanUsed(stream, pose, static_cast<Stamp>(10 * sequence), true, 1.0);
  }
  std::vector<NameId> waiting;
  server::SessionRecord::WaitingScans numbers;
  pipeline.ForEachWaiting([&](const Scan&) {
    waiting.push_back(HashName("laser"));
    const std::uint64_t sequence = 2 + waiting.size();
    static_cast<void>(record.ScanReceived(stream, sequence));
    numbers[HashName("laser")].insert(sequence);
  });
  writer(std::uint32_t{3}, std::uint64_t{kTokenBefore}, false, 0.0, std::string(), std::optional<std::uint64_t>(),
         Stamp{0}, waiting);
  Must(record.Save(writer, numbers), "the account of a session");
  return std::string(1, static_cast<char>(kServer)) + Piece(writer.Bytes()) + StateOf(saved);
}

std::vector<std::string> SeedsOfCheckpoints() {
  std::vector<std::string> seeds;
  for (std::size_t kind = 0; kind < kFilters.size(); ++kind)
    for (const int scans : {0, 1, 4}) seeds.push_back(SeedOf(kind, scans));
  for (const int scans : {0, 1}) seeds.push_back(SeedOfServer(scans));
  return seeds;
}

const bool kCheckpointTarget = Register({"checkpoint", &RunCheckpoint, &SeedsOfCheckpoints});

}  // namespace
}  // namespace cairn::fuzz
