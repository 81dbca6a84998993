// Decides what of the wire's values goes into a recording, and under which name. Samples of robots name only hashes:
// they wait until a session, a pose or a ledger has told the names. What changes the state of a robot, a job or a map
// becomes a line of the recording's log. Bounded: robots, sensors, streams, jobs and what waits. Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/record_queue.h"
#include "client/cli/recording_file.h"

namespace cairn::client {

struct RecorderOptions {
  // Empty: all. Where only sites are named, the robots in them; where only robots are, the sites they are in.
  std::vector<std::string> robots;
  std::vector<std::string> sites;
};

class Recorder {
 public:
  static constexpr std::size_t kMaxRobots = 1024;
  static constexpr std::size_t kMaxSensors = 4096;
  static constexpr std::size_t kMaxSites = 16;
  static constexpr std::size_t kMaxWaitingBytes = std::size_t{16} << 20;

  struct Account {
    std::uint64_t missing = 0;   // Samples that did not arrive here, by their numbers; not those before the first one.
    std::uint64_t repeated = 0;  // Sent again by a robot after a reconnection: they are recorded once.
    std::uint64_t nameless = 0;  // Samples of robots or sensors that the server does not know.
  };

  // `file` outlives the recorder.
  Recorder(RecordingFile& file, RecorderOptions options) : file_(file), options_(std::move(options)) {}

  // Errors: the file cannot be written any more.
  [[nodiscard]] Result<void> Take(RecordEvent&& event);

  // The sites whose maps are to be recorded, at most kMaxSites.
  [[nodiscard]] const std::set<std::string>& sites() const { return sites_; }
  // The robots of which something was recorded.
  [[nodiscard]] std::vector<std::string> robots() const;
  // What still waits for its names counts as nameless.
  [[nodiscard]] Account account() const;

 private:
  struct Robot {
    std::string name;
    std::string site;
    SessionState state;  // Its session is 0 until one is told.
    PoseReason reason = PoseReason::kWaiting;
    bool recorded = false;
  };
  struct Stream {
    SessionToken session = 0;
    std::uint64_t last = 0;  // Number of the last sample.
    std::uint64_t dropped = 0;
    std::int64_t told = 0;  // When something of it was written to the log.
  };
  using StreamKey = std::pair<NameId, NameId>;  // Robot and sensor.

  [[nodiscard]] Result<void> On(ScanSample& sample, std::int64_t time);
  [[nodiscard]] Result<void> On(OdometrySample& sample, std::int64_t time);
  [[nodiscard]] Result<void> On(PoseReport& pose, std::int64_t time);
  [[nodiscard]] Result<void> On(SessionState& state, std::int64_t time);
  [[nodiscard]] Result<void> On(Ledger& ledger, std::int64_t time);
  [[nodiscard]] Result<void> On(Job& job, std::int64_t time);
  [[nodiscard]] Result<void> On(MapInfo& info, std::int64_t time);

  // Whether the names of a sample are known; true for everything else.
  [[nodiscard]] bool IsNamed(const RecordEvent& event) const;
  [[nodiscard]] Result<void> TakeWaiting();
  // Null where the names are not those of the ids, or there are too many.
  Robot* Learn(NameId id, const std::string& name, const std::string& site);
  [[nodiscard]] bool Wants(const Robot& robot) const;
  [[nodiscard]] bool WantsSite(const std::string& site) const;
  void AddSite(const std::string& site);
  // Whether the sample is the next one of its stream; notes gaps.
  [[nodiscard]] Result<bool> IsNew(const StreamId& id, std::uint64_t sequence, const std::string& robot,
                                   const char* what, std::int64_t time);
  [[nodiscard]] Result<void> NoteGeneration(Generation generation, std::int64_t time);

  RecordingFile& file_;
  const RecorderOptions options_;
  std::map<NameId, Robot> robots_;
  std::map<NameId, std::string> sensors_;
  std::map<StreamKey, Stream> streams_;
  std::map<std::string, std::uint32_t> epochs_;  // Of the maps.
  std::map<std::uint64_t, JobState> jobs_;
  std::set<std::string> sites_;
  std::deque<RecordEvent> waiting_;
  std::size_t waiting_bytes_ = 0;
  bool named_ = false;  // Something has got a name since the waiting were looked through.
  Generation generation_ = 0;
  Account account_;
};

}  // namespace cairn::client
