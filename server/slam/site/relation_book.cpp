#include "server/slam/site/relation_book.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

constexpr std::uint32_t kBookFormat = 1;
// A guess that has moved by less is the same for a measurement that found nothing or was withdrawn.
constexpr double kSameGuessM = 0.1;
constexpr double kSameGuessRad = 0.03;
// A search of a stretch looks farther where the way is longer. So much more does not count.
constexpr double kSameWayM = 5.0;

// What no measurement can have, although it is a number.
bool IsSane(const Measurement& one) {
  if (!one.found) return !one.believed;
  const Eigen::Matrix3d& P = one.covariance;
  return one.T_known_seen.translation().allFinite() && std::isfinite(one.T_known_seen.theta) &&
         P.isApprox(P.transpose(), 1e-6) && P.llt().info() == Eigen::Success;
}

}  // namespace

bool Measurement::Holds(const Pose2& guess_now, double way_now_m) const {
  if (believed) return true;
  const Pose2 moved = Between(guess, guess_now);
  return way_now_m <= way_m + kSameWayM && moved.translation().norm() < kSameGuessM &&
         std::abs(moved.theta) < kSameGuessRad;
}

const Measurement* RelationBook::Find(const Pair& pair, MeasurementKind kind, const KeyframeId& seen) {
  const auto page = pages_.find(pair);
  if (page == pages_.end()) return nullptr;
  const auto kept = page->second.find({kind, seen.number});
  if (kept == page->second.end() || kept->second.measurement.seen != seen) return nullptr;
  kept->second.used = job_;
  return &kept->second.measurement;
}

void RelationBook::Note(const Pair& pair, MeasurementKind kind, const Measurement& measurement) {
  const auto [kept, added] = pages_[pair].insert_or_assign({kind, measurement.seen.number}, Kept{measurement, job_});
  if (added) ++size_;
  ++measured_;
  changed_.insert(pair);
}

void RelationBook::ForEachBelieved(const Pair& pair, const Visit& visit) const {
  const auto page = pages_.find(pair);
  if (page == pages_.end()) return;
  for (const auto& [key, kept] : page->second)
    if (kept.measurement.believed) visit(kept.measurement);
}

void RelationBook::SetBelieved(const Pair& pair, const Believes& believes) {
  const auto page = pages_.find(pair);
  if (page == pages_.end()) return;
  for (auto& [key, kept] : page->second) {
    const bool believed = kept.measurement.found && believes(kept.measurement);
    if (believed == kept.measurement.believed) continue;
    kept.measurement.believed = believed;
    changed_.insert(pair);
  }
}

const SolvedPath* RelationBook::PathOf(std::uint64_t session) const {
  const auto path = paths_.find(session);
  return path == paths_.end() ? nullptr : &path->second;
}

void RelationBook::BeginJob() {
  ++job_;
  measured_ = reused_ = 0;
}

void RelationBook::EndJob(const std::function<bool(std::uint64_t)>& is_there) {
  for (auto page = pages_.begin(); page != pages_.end();) {
    if (is_there(page->first.known) && is_there(page->first.seen)) {
      ++page;
      continue;
    }
    size_ -= page->second.size();
    changed_.insert(page->first);
    page = pages_.erase(page);
  }
  std::erase_if(paths_, [&is_there](const auto& path) { return !is_there(path.first); });
  RemoveSurplus();
}

void RelationBook::RemoveSurplus() {
  if (size_ <= most_) return;
  struct Candidate {
    std::uint64_t used = 0;
    bool believed = false;
    Pair pair;
    Key key;
  };
  std::vector<Candidate> all;
  all.reserve(size_);
  for (const auto& [pair, page] : pages_)
    for (const auto& [key, kept] : page) all.push_back({kept.used, kept.measurement.believed, pair, key});
  const auto surplus = static_cast<std::ptrdiff_t>(size_ - most_);
  std::nth_element(all.begin(), all.begin() + surplus, all.end(), [](const Candidate& a, const Candidate& b) {
    return std::tie(a.used, a.believed, a.pair, a.key) < std::tie(b.used, b.believed, b.pair, b.key);
  });
  for (auto one = all.begin(); one != all.begin() + surplus; ++one) {
    const auto page = pages_.find(one->pair);
    page->second.erase(one->key);
    if (page->second.empty()) pages_.erase(page);
    changed_.insert(one->pair);
  }
  size_ = most_;
}

std::vector<RelationBook::Pair> RelationBook::TakeChanged() {
  std::vector<Pair> pairs(changed_.begin(), changed_.end());
  changed_.clear();
  return pairs;
}

std::string RelationBook::BytesOf(const Pair& pair) const {
  const auto page = pages_.find(pair);
  if (page == pages_.end()) return {};
  StateWriter writer;
  writer(kBookFormat, static_cast<std::uint64_t>(page->second.size()));
  for (const auto& [key, kept] : page->second) writer(key.kind, kept.measurement);
  return writer.Bytes();
}

Result<void> RelationBook::Restore(const Pair& pair, std::string_view bytes) {
  StateReader reader(bytes);
  std::uint32_t format = 0;
  std::uint64_t count = 0;
  reader(format, count);
  Page page;
  bool good = reader.ok() && format == kBookFormat;
  for (std::uint64_t i = 0; good && i < count; ++i) {
    MeasurementKind kind{};
    Measurement one;
    reader(kind, one);
    good = reader.ok() && kind <= MeasurementKind::kPlace && IsSane(one);
    if (good) page.insert_or_assign({kind, one.seen.number}, Kept{one, job_});
  }
  if (!good || !reader.done()) return Fail(StatusCode::kDataLoss, "these are no measurements between two sessions");
  Page& kept = pages_[pair];
  size_ += page.size() - kept.size();
  kept = std::move(page);
  return {};
}

}  // namespace cairn::slam
