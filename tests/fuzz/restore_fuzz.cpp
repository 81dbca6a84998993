// Whole state directories: pieces, each a kind, an owner, a number and a record. A server starts on them, or refuses to
// with a reason; then it answers everything and maps on.
#include "tests/fuzz/restored_rooms.h"
#include "tests/fuzz/stored_samples.h"

namespace cairn::fuzz {
namespace {

using namespace server;

bool RunRestore(std::string_view input) {
  MemoryStore store;
  for (Pieces pieces(input); !pieces.empty();) {
    const auto kind = static_cast<RecordKind>(pieces.Take() % 8);
    const std::uint64_t owner = pieces.Take(), number = pieces.Take<std::uint16_t>();
    store.Put({kind, owner == 0 ? HashName("lab") : owner, number}, pieces.TakePiece());
  }
  return StartOn(store) != Restored::kNothing;
}

std::string Stored(RecordKind kind, std::uint8_t owner, std::uint16_t number, const std::string& bytes) {
  std::string record = {static_cast<char>(kind), static_cast<char>(owner), static_cast<char>(number & 0xff),
                        static_cast<char>(number >> 8)};
  return record + Piece(bytes);
}

std::string StoredDrive() {
  const std::uint64_t robot = HashName("r5");
  std::vector<JournalEntry> entries = {OwnerChanged{kReturning, kTokenBefore, {"laser"}}};
  for (int step = 0; step < 4; ++step) {
    entries.push_back(
        OdometryTaken{{robot, HashName("odometry"), kTokenBefore}, testing::RoomOdometry(step), OdometryUse::kTaken});
    entries.push_back(
        ScanTaken{{robot, HashName("laser"), kTokenBefore}, std::make_shared<const Scan>(SmallScan(step))});
  }
  entries.push_back(ScanRefused{{robot, HashName("laser"), kTokenBefore}, 5, DropReason::kQueueFull});
  return Stored(RecordKind::kJournal, 5, 10, BytesOf(1, entries));
}

std::vector<std::string> SeedsOfStores() {
  StoredSession session = testing::SampleSession(5);
  session.request.T_map_robot_start = kStart;
  StoredSite site = server::testing::SampleSiteRecord(), plain = server::testing::SampleSiteRecord();
  plain.enabled_version = 1;
  plain.next_version = 2;
  const std::string opened = Stored(RecordKind::kSession, 5, 0, BytesOf(session));
  const std::string versions = Stored(RecordKind::kSite, 0, 0, BytesOf(site)) +
                               Stored(RecordKind::kMapVersion, 0, 3, BytesOf(SampleVersion(false)));
  const std::string finished = Stored(RecordKind::kJournal, 5, 12,
                                      BytesOf(11, {CorrectionTaken{2, 101, {.keyframes = 1, .chunks = {}}},
                                                   SessionFinished{true, {StatusCode::kUnavailable, "gone"}}}));
  const std::string jobs = Stored(RecordKind::kJob, 4, 0, BytesOf(SampleJob(4, JobState::kRunning))) +
                           Stored(RecordKind::kJob, 3, 0, BytesOf(SampleJob(3, JobState::kSucceeded)));
  return {
      opened,
      opened + StoredDrive(),
      versions + opened + StoredDrive(),
      versions + opened + StoredDrive() + finished + jobs,
      jobs,
      versions,
      Stored(RecordKind::kSite, 0, 0, BytesOf(plain)) + Stored(RecordKind::kLayer, 0, 6, BytesOf(StoredLayer{6, {}})),
      Stored(RecordKind::kSite, 0, 0, BytesOf(plain)) +
          Stored(RecordKind::kLayer, 0, 6, BytesOf(StoredLayer{6, OneChunk()}))};
}

const bool kRestoreTarget = Register({"restore", &RunRestore, &SeedsOfStores});

}  // namespace
}  // namespace cairn::fuzz
