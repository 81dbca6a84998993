// What a robot has given to its client and the server may need, or need again: scans and odometry in the order in which
// they were given. It is cut off at the front as the server says what is safe, and walked through by a cursor: what is
// behind the cursor was sent, what is before it was not yet.
// Bounded: beyond `max_bytes` the oldest samples move into the spill file, where there is one; otherwise they are given
// up and counted. Pure bookkeeping but for that file: no wire, no clock. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "client/lib/spill_file.h"
#include "common/service/stream.h"

namespace cairn::client {

using StreamedSample = std::variant<ScanSample, OdometrySample>;

class Backlog {
 public:
  explicit Backlog(std::size_t max_bytes) : max_bytes_(max_bytes) {}
  void SpillTo(std::unique_ptr<SpillFile> file) { spill_ = std::move(file); }

  // At the end. REQUIRES: the sample has its number.
  void Add(StreamedSample&& sample);
  // Removes the newest again: it can never be sent.
  void TakeBack();
  // What the server has of a stream up to this number will not be needed again. Only what was sent can be safe.
  void Safe(NameId sensor_id, std::uint64_t through);

  // The sample at the cursor, which then moves on. Nothing where all were sent.
  [[nodiscard]] std::shared_ptr<const StreamedSample> Next();
  // Its number; nothing where all were sent or it is odometry.
  [[nodiscard]] std::optional<std::pair<NameId, std::uint64_t>> next_scan() const;
  void StepBack();  // The last one from Next was not sent.
  void Rewind() { cursor_ = 0; }
  [[nodiscard]] std::size_t unsent() const { return entries_.size() - cursor_; }
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] bool HasScan() const;

  // All that is kept moves into another session: numbers begin at 1 again, and the last odometry that was safe comes
  // first, because the first scan needs some before it. Returns the highest number of each stream.
  std::map<NameId, std::uint64_t> MoveTo(SessionToken session);

  // The odometry at the first kept scan, interpolated; the nearest one where there is none before or none after.
  // Nothing without a scan or without odometry. `complete`: whether there is odometry at or after the scan.
  struct AtFirstScan {
    Pose2 T_odom_robot;
    bool complete = false;
  };
  [[nodiscard]] std::optional<AtFirstScan> OdometryAtFirstScan() const;

  // Samples given up before they were safe.
  [[nodiscard]] std::uint64_t displaced() const { return displaced_; }
  // Why the spill file is no longer used; empty while it is.
  [[nodiscard]] const std::string& spill_error() const { return spill_error_; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }  // In memory.

 private:
  struct Entry {
    NameId sensor_id = 0;
    std::uint64_t sequence = 0;
    bool is_scan = false;
    std::size_t bytes = 0;
    std::shared_ptr<StreamedSample> sample;  // Null where it is in the spill file.
    std::uint64_t place = 0;
  };

  void PopFront();
  void Bound();
  [[nodiscard]] bool Spill();
  [[nodiscard]] std::shared_ptr<StreamedSample> Load(const Entry& entry) const;

  const std::size_t max_bytes_;
  std::deque<Entry> entries_;
  std::size_t cursor_ = 0;   // Into entries_.
  std::size_t spilled_ = 0;  // So many at the front are in the spill file.
  std::size_t bytes_ = 0;
  std::map<NameId, std::uint64_t> safe_;
  std::optional<OdometrySample> last_odometry_;  // The last one that left at the front.
  SessionToken session_ = 0;                     // What spilled samples belong to by now; 0: as they were given.
  std::uint64_t displaced_ = 0;
  std::unique_ptr<SpillFile> spill_;
  std::string spill_error_;
};

}  // namespace cairn::client
