// What smoothing jobs of a site have measured between its sessions, kept from one job to the next, so that a job
// measures only what is new. It holds measurements, not decisions: which of them are believed is decided anew by every
// job (site_smoothing.h), with all relations that there are then. A measurement belongs to two keyframes, each known by
// its number and its stamp. It is used again as long as both keyframes are there and are believed to lie about as they
// were when it was made; those that found nothing, and those that were withdrawn, are made again where that has
// changed. A place that was looked for in a whole map is looked for again when one of the two maps has grown by a
// quarter. Bounded: those that were not used for the longest time go first. Values that are missing or wrong only cost
// time, but for a relation, which must be consistent with the others as every new one must. Not thread-safe;
// deterministic.
#pragma once

#include <Eigen/Core>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "common/status.h"

namespace cairn::slam {

// A keyframe of a session, whatever its index is now.
struct KeyframeId {
  std::uint64_t number = 0;
  Stamp stamp = 0;

  bool operator==(const KeyframeId&) const = default;
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.number, self.stamp);
  }
};

enum class MeasurementKind : std::uint8_t { kRevisit = 0, kStretch = 1, kPlace = 2 };  // As in relation_search.h.

struct Measurement {
  KeyframeId known{};  // Of a place that was not found it means nothing.
  KeyframeId seen{};
  // T_known_seen before the measurement. Of a place, the pose of the last keyframe of what was looked for, seen from
  // the keyframe `seen`; its relation is with that last one.
  Pose2 guess{};
  double way_m = 0.0;  // The way from what was taken as known, with which the doubt of the guess grew.
  // For places: how many keyframes the two sessions had had.
  std::uint64_t known_made = 0;
  std::uint64_t seen_made = 0;
  bool found = false;
  bool believed = false;  // It was among the relations of the last job's result. Found and not believed: withdrawn.
  Pose2 T_known_seen{};
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();

  // Whether it says enough about a guess that is not the one it was made with.
  [[nodiscard]] bool Holds(const Pose2& guess_now, double way_now_m) const;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.known, self.seen, self.guess, self.way_m, self.known_made, self.seen_made, self.found, self.believed);
    if (self.found) archive(self.T_known_seen, self.covariance);
  }
};

// Where a job has put the keyframes of a session: T_site_robot of each, in the frame of a session by its id.
struct SolvedPath {
  std::uint64_t frame = 0;
  std::vector<KeyframeId> keyframes;
  std::vector<Pose2> path;
};

class RelationBook {
 public:
  // Two sessions, by their ids: something seen in the second was looked for in the first.
  struct Pair {
    std::uint64_t known = 0;
    std::uint64_t seen = 0;
    auto operator<=>(const Pair&) const = default;
  };
  static constexpr std::size_t kMostMeasurements = 200'000;  // 40 MiB.

  explicit RelationBook(std::size_t most = kMostMeasurements) : most_(most) {}

  // The measurement of a keyframe of `seen`, named by its number. Null: there is none, or it is of another keyframe.
  [[nodiscard]] const Measurement* Find(const Pair& pair, MeasurementKind kind, const KeyframeId& seen);
  // Replaces an earlier one of the same keyframe.
  void Note(const Pair& pair, MeasurementKind kind, const Measurement& measurement);
  // A measurement that was found is used without being made again.
  void CountReused() { ++reused_; }
  // All that are believed of a pair.
  using Visit = std::function<void(const Measurement& measurement)>;
  void ForEachBelieved(const Pair& pair, const Visit& visit) const;
  // From now on those are believed for which `believes` says so. It is asked about each that was found.
  using Believes = std::function<bool(const Measurement& measurement)>;
  void SetBelieved(const Pair& pair, const Believes& believes);

  // The last job's path of a session, from which the next one's search begins, so that what has not changed stays where
  // it is, to the millimetre. In memory only. Null: none is known.
  [[nodiscard]] const SolvedPath* PathOf(std::uint64_t session) const;
  void SetPath(std::uint64_t session, SolvedPath path) { paths_[session] = std::move(path); }
  void ForgetPath(std::uint64_t session) { paths_.erase(session); }

  // How many were made, and how many were used again, since BeginJob.
  [[nodiscard]] std::size_t measured() const { return measured_; }
  [[nodiscard]] std::size_t reused() const { return reused_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  void BeginJob();
  // Removes pairs of which a session is not there any more, and what is too much.
  void EndJob(const std::function<bool(std::uint64_t session)>& is_there);

  // Pairs that changed since the last call; one without bytes (BytesOf) is gone.
  [[nodiscard]] std::vector<Pair> TakeChanged();
  [[nodiscard]] std::string BytesOf(const Pair& pair) const;
  // DATA_LOSS: these are no such bytes; the pair is as before.
  [[nodiscard]] Result<void> Restore(const Pair& pair, std::string_view bytes);

 private:
  struct Key {
    MeasurementKind kind{};
    std::uint64_t seen = 0;  // The keyframe's number.
    auto operator<=>(const Key&) const = default;
  };
  struct Kept {
    Measurement measurement;
    std::uint64_t used = 0;  // By which job last.
  };
  using Page = std::map<Key, Kept>;
  void RemoveSurplus();

  std::size_t most_;
  std::map<Pair, Page> pages_;
  std::map<std::uint64_t, SolvedPath> paths_;  // By session.
  std::set<Pair> changed_;
  std::size_t size_ = 0;
  std::uint64_t job_ = 1;
  std::size_t measured_ = 0;
  std::size_t reused_ = 0;
};

}  // namespace cairn::slam
