#include "client/lib/backlog.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/sensor/stamp.h"

namespace cairn::client {
namespace {

StreamId& StreamOf(StreamedSample& sample) {
  return std::visit([](auto& one) -> StreamId& { return one.stream; }, sample);
}

std::uint64_t& SequenceOf(StreamedSample& sample) {
  if (auto* const scan = std::get_if<ScanSample>(&sample)) return scan->scan.sequence;
  return std::get<OdometrySample>(sample).odometry.sequence;
}

std::size_t BytesOf(const StreamedSample& sample) {
  constexpr std::size_t kOverhead = 128;  // Memory of an entry and its allocations.
  const auto* const scan = std::get_if<ScanSample>(&sample);
  return sizeof(StreamedSample) + kOverhead + (scan != nullptr ? scan->scan.ranges_m.size() * sizeof(float) : 0);
}

// All members but the ranges, as they are in memory: the file is read by the process that wrote it.
struct PlainScan {
  StreamId stream;
  std::uint64_t sequence;
  Stamp stamp;
  double angle_first_rad, angle_step_rad, range_min_m, range_max_m, beam_period_s, tilt_rad;
  Pose2 T_robot_laser;
};
static_assert(std::is_trivially_copyable_v<PlainScan> && std::is_trivially_copyable_v<OdometrySample>);

template <typename Plain>
std::string BytesOfPlain(const Plain& plain) {
  std::string bytes(sizeof(plain), '\0');
  std::memcpy(bytes.data(), &plain, sizeof(plain));
  return bytes;
}

std::string Encode(const StreamedSample& sample) {
  if (const auto* const odometry = std::get_if<OdometrySample>(&sample)) return BytesOfPlain(*odometry);
  const ScanSample& value = std::get<ScanSample>(sample);
  const Scan& scan = value.scan;
  std::string bytes = BytesOfPlain(PlainScan{value.stream, scan.sequence, scan.stamp, scan.angle_first_rad,
                                             scan.angle_step_rad, scan.range_min_m, scan.range_max_m,
                                             scan.beam_period_s, scan.tilt_rad, scan.T_robot_laser});
  bytes.append(reinterpret_cast<const char*>(scan.ranges_m.data()), scan.ranges_m.size() * sizeof(float));
  return bytes;
}

std::optional<StreamedSample> Decode(bool is_scan, const std::string& bytes) {
  if (!is_scan) {
    OdometrySample odometry;
    if (bytes.size() != sizeof(odometry)) return std::nullopt;
    std::memcpy(&odometry, bytes.data(), sizeof(odometry));
    return odometry;
  }
  PlainScan plain;
  if (bytes.size() < sizeof(plain)) return std::nullopt;
  std::memcpy(&plain, bytes.data(), sizeof(plain));
  std::vector<float> ranges_m((bytes.size() - sizeof(plain)) / sizeof(float));
  std::memcpy(ranges_m.data(), bytes.data() + sizeof(plain), ranges_m.size() * sizeof(float));
  return ScanSample{plain.stream,
                    {.sequence = plain.sequence,
                     .stamp = plain.stamp,
                     .angle_first_rad = plain.angle_first_rad,
                     .angle_step_rad = plain.angle_step_rad,
                     .range_min_m = plain.range_min_m,
                     .range_max_m = plain.range_max_m,
                     .beam_period_s = plain.beam_period_s,
                     .tilt_rad = plain.tilt_rad,
                     .T_robot_laser = plain.T_robot_laser,
                     .ranges_m = std::move(ranges_m)}};
}

Pose2 PoseAt(const Odometry& before, const Odometry& after, Stamp stamp) {
  if (after.stamp <= before.stamp) return after.T_odom_robot;
  // A broken clock may be anywhere in int64.
  const double share = static_cast<double>(NanosBetween(before.stamp, stamp)) /
                       static_cast<double>(NanosBetween(before.stamp, after.stamp));
  return Interpolate(before.T_odom_robot, after.T_odom_robot, share);
}

}  // namespace

void Backlog::Add(StreamedSample&& sample) {
  Entry entry;
  entry.sensor_id = StreamOf(sample).sensor_id;
  entry.sequence = SequenceOf(sample);
  entry.is_scan = std::holds_alternative<ScanSample>(sample);
  entry.bytes = BytesOf(sample);
  entry.sample = std::make_shared<StreamedSample>(std::move(sample));
  bytes_ += entry.bytes;
  entries_.push_back(std::move(entry));
  Bound();
}

void Backlog::TakeBack() {
  if (entries_.empty()) return;
  if (entries_.back().sample != nullptr) bytes_ -= entries_.back().bytes;
  entries_.pop_back();
  cursor_ = std::min(cursor_, entries_.size());
  spilled_ = std::min(spilled_, entries_.size());
}

void Backlog::Safe(NameId sensor_id, std::uint64_t through) {
  safe_[sensor_id] = through;
  while (cursor_ > 0 && entries_.front().sequence <= safe_[entries_.front().sensor_id]) PopFront();
}

void Backlog::PopFront() {
  const Entry& front = entries_.front();
  if (!front.is_scan) {
    if (const auto odometry = Load(front)) last_odometry_ = std::get<OdometrySample>(*odometry);
  }
  if (front.sample != nullptr) bytes_ -= front.bytes;
  if (spilled_ > 0 && --spilled_ == 0) spill_->Clear();
  if (cursor_ > 0) --cursor_;
  entries_.pop_front();
}

// The newest sample stays in memory, however large it is: it is about to be sent.
void Backlog::Bound() {
  while (bytes_ > max_bytes_ && entries_.size() > spilled_ + 1) {
    if (Spill()) continue;
    ++displaced_;
    PopFront();
  }
}

bool Backlog::Spill() {
  if (spill_ == nullptr) return false;
  Entry& entry = entries_[spilled_];  // Stays where it is in memory while entries before it are removed.
  const std::string bytes = Encode(*entry.sample);
  auto place = spill_->Append(bytes);
  while (!place) {
    spill_error_ = place.error().message;
    if (spilled_ == 0) return false;
    // The oldest in the file make room there, no more of them than necessary.
    ++displaced_;
    PopFront();
    if (spilled_ > 0) spill_->Forget(entries_.front().place);
    place = spill_->Append(bytes);
  }
  entry.place = *place;
  entry.sample.reset();
  bytes_ -= entry.bytes;
  ++spilled_;
  return true;
}

std::shared_ptr<StreamedSample> Backlog::Load(const Entry& entry) const {
  if (entry.sample != nullptr) return entry.sample;
  const auto bytes = spill_->Read(entry.place);
  std::optional<StreamedSample> sample = bytes ? Decode(entry.is_scan, *bytes) : std::nullopt;
  if (!sample) return nullptr;
  SequenceOf(*sample) = entry.sequence;
  if (session_ != 0) StreamOf(*sample).session = session_;
  return std::make_shared<StreamedSample>(*std::move(sample));
}

std::shared_ptr<const StreamedSample> Backlog::Next() {
  while (cursor_ < entries_.size()) {
    if (auto sample = Load(entries_[cursor_++])) return sample;
    spill_error_ = "the spill file cannot be read";
    ++displaced_;
  }
  return nullptr;
}

std::optional<std::pair<NameId, std::uint64_t>> Backlog::next_scan() const {
  if (cursor_ >= entries_.size() || !entries_[cursor_].is_scan) return std::nullopt;
  return std::pair(entries_[cursor_].sensor_id, entries_[cursor_].sequence);
}

std::optional<std::uint64_t> Backlog::OldestOf(NameId sensor_id) const {
  const auto oldest = std::ranges::find(entries_, sensor_id, &Entry::sensor_id);
  return oldest == entries_.end() ? std::nullopt : std::optional(oldest->sequence);
}

void Backlog::StepBack() {
  if (cursor_ > 0) --cursor_;
}

std::optional<Stamp> Backlog::FirstScan() const {
  for (const Entry& entry : entries_) {
    if (!entry.is_scan) continue;
    if (const auto sample = Load(entry)) return std::get<ScanSample>(*sample).scan.stamp;
  }
  return std::nullopt;
}

std::map<NameId, std::uint64_t> Backlog::MoveTo(SessionToken session) {
  if (last_odometry_) {
    // It is in memory, but in front of samples that may be in the spill file, so it counts as one of those.
    Entry entry;
    entry.sensor_id = last_odometry_->stream.sensor_id;
    entry.sample = std::make_shared<StreamedSample>(*std::exchange(last_odometry_, std::nullopt));
    entry.bytes = BytesOf(*entry.sample);
    bytes_ += entry.bytes;
    if (spilled_ > 0) ++spilled_;
    entries_.push_front(std::move(entry));
  }
  safe_.clear();
  session_ = session;
  cursor_ = 0;
  std::map<NameId, std::uint64_t> highest;
  for (Entry& entry : entries_) {
    entry.sequence = ++highest[entry.sensor_id];
    if (entry.sample == nullptr) continue;
    // A copy, because a sender may still hold the old one.
    entry.sample = std::make_shared<StreamedSample>(*entry.sample);
    SequenceOf(*entry.sample) = entry.sequence;
    StreamOf(*entry.sample).session = session;
  }
  return highest;
}

std::optional<Backlog::AtFirstScan> Backlog::OdometryAtFirstScan() const {
  std::optional<Odometry> before;
  if (last_odometry_) before = last_odometry_->odometry;
  std::optional<Stamp> stamp;
  // Odometry may have been given before or after the scan.
  for (const Entry& entry : entries_) {
    if (entry.is_scan && stamp) continue;
    const auto sample = Load(entry);
    if (sample == nullptr) continue;
    if (const auto* const scan = std::get_if<ScanSample>(sample.get())) {
      stamp = scan->scan.stamp;
      if (before && before->stamp >= *stamp) return AtFirstScan{before->T_odom_robot, before->stamp, true};
      continue;
    }
    const Odometry& odometry = std::get<OdometrySample>(*sample).odometry;
    if (stamp && odometry.stamp >= *stamp) {
      return AtFirstScan{before ? PoseAt(*before, odometry, *stamp) : odometry.T_odom_robot, odometry.stamp, true};
    }
    before = odometry;
  }
  if (!stamp || !before) return std::nullopt;
  return AtFirstScan{before->T_odom_robot, before->stamp, false};
}

}  // namespace cairn::client
