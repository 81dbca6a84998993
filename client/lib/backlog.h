// The queue of samples (scans and odometry, in the order in which the robot's program gave them) that the server may
// need to receive, or to receive again. A sample is removed from the front when the server reports that it is safe
// (durable, or settled if the server stores nothing). A cursor divides the queue: samples before the cursor were sent,
// the sample at the cursor is the next one to send. Bounded: above `max_bytes` the oldest samples are moved into the
// spill file if there is one. Without one, or where the disk is full, the oldest are dropped and counted. Does no other
// I/O and uses no clock. Not thread-safe.
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

  // Adds a sample at the end. REQUIRES: the sample has its sequence number.
  void Add(StreamedSample&& sample);
  // Removes the newest sample, because it can never be sent.
  void TakeBack();
  // The samples of this stream up to this number are safe on the server and are removed. Samples that were not sent yet
  // stay.
  void Safe(NameId sensor_id, std::uint64_t through);

  // Returns the sample at the cursor and moves the cursor on. Null if all were sent.
  [[nodiscard]] std::shared_ptr<const StreamedSample> Next();
  // Stream and number of the sample at the cursor. Nothing if all were sent or if it is odometry.
  [[nodiscard]] std::optional<std::pair<NameId, std::uint64_t>> next_scan() const;
  void StepBack();  // The last sample from Next was not sent.
  void Rewind() { cursor_ = 0; }
  [[nodiscard]] std::size_t unsent() const { return entries_.size() - cursor_; }
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  // The number of the oldest sample of this stream in the queue.
  [[nodiscard]] std::optional<std::uint64_t> OldestOf(NameId sensor_id) const;
  // The stamp of the first scan in the queue.
  [[nodiscard]] std::optional<Stamp> FirstScan() const;

  // Assigns all samples to another session. Their numbers begin at 1 again. The last odometry sample that was removed
  // is put in front, because the first scan needs odometry before it. Returns the highest number of each stream.
  std::map<NameId, std::uint64_t> MoveTo(SessionToken session);

  // The odometry at the stamp of the first scan in the queue, interpolated; the nearest sample if there is none before
  // or none after it. Nothing if there is no scan or no odometry. `complete`: there is odometry at or after the scan.
  struct AtFirstScan {
    Pose2 T_odom_robot;
    Stamp newest = 0;  // Of the odometry that was used.
    bool complete = false;
  };
  [[nodiscard]] std::optional<AtFirstScan> OdometryAtFirstScan() const;

  // Number of samples that were dropped before they were safe.
  [[nodiscard]] std::uint64_t displaced() const { return displaced_; }
  // Why the spill file did not take or give a sample, the last time; empty where it always did.
  [[nodiscard]] const std::string& spill_error() const { return spill_error_; }
  [[nodiscard]] std::uint64_t spilled_bytes() const { return spill_ != nullptr ? spill_->size() : 0; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }  // Memory used.

 private:
  struct Entry {
    NameId sensor_id = 0;
    std::uint64_t sequence = 0;
    bool is_scan = false;
    std::size_t bytes = 0;
    std::shared_ptr<StreamedSample> sample;  // Null if it is in the spill file.
    std::uint64_t place = 0;
  };

  void PopFront();
  void Bound();
  [[nodiscard]] bool Spill();
  [[nodiscard]] std::shared_ptr<StreamedSample> Load(const Entry& entry) const;

  const std::size_t max_bytes_;
  std::deque<Entry> entries_;
  std::size_t cursor_ = 0;   // Index in entries_.
  std::size_t spilled_ = 0;  // Number of entries at the front that are in the spill file.
  std::size_t bytes_ = 0;
  std::map<NameId, std::uint64_t> safe_;
  std::optional<OdometrySample> last_odometry_;  // The last one removed at the front.
  SessionToken session_ = 0;                     // Session that the spilled samples now belong to; 0: as given.
  std::uint64_t displaced_ = 0;
  std::unique_ptr<SpillFile> spill_;
  std::string spill_error_;
};

}  // namespace cairn::client
