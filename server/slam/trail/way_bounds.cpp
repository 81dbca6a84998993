#include "server/slam/trail/way_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace cairn::slam {
namespace {

float RoundedUp(double value) {
  const auto nearest = static_cast<float>(value);
  return static_cast<double>(nearest) < value ? std::nextafter(nearest, std::numeric_limits<float>::infinity())
                                              : nearest;
}

}  // namespace

void WayBounds::Hub::Append(double way_m) {
  std::size_t block = ways_m.size();
  const float rounded_m = RoundedUp(way_m);
  ways_m.push_back(rounded_m);
  for (std::vector<float>& longest : longest_m) {
    block >>= kBits;
    if (block == longest.size()) longest.push_back(rounded_m);
    longest[block] = std::max(longest[block], rounded_m);
  }
}

void WayBounds::Append(double step_m) {
  for (Hub& hub : hubs_) hub.Append(hub.ways_m.back() + step_m);
  SortHubs();
}

// Relations between older keyframes may shorten many ways. That is left to the next hub.
void WayBounds::AddRelation(std::size_t from, std::size_t to, double way_m) {
  for (Hub& hub : hubs_) {
    const std::size_t last = hub.ways_m.size() - 1;
    if (to != last && from != last) continue;
    const std::size_t other = to == last ? from : to;
    hub.ways_m[last] = std::min(hub.ways_m[last], RoundedUp(hub.ways_m[other] + way_m));
  }
  SortHubs();
}

void WayBounds::AddHub(std::span<const double> ways_m) {
  const bool replaces_nearest = !hubs_.empty() && hubs_.front().ways_m.back() < kSamePlaceM;
  if (!replaces_nearest && hubs_.size() < kMostHubs) {
    hubs_.emplace_back();
    std::swap(hubs_.front(), hubs_.back());
  } else if (!replaces_nearest) {
    const auto idle =
        std::min_element(hubs_.begin(), hubs_.end(), [](const Hub& a, const Hub& b) { return a.used_at < b.used_at; });
    std::swap(hubs_.front(), *idle);
  }
  Hub hub;
  for (const double way_m : ways_m) hub.Append(way_m);
  hub.used_at = ways_m.size();
  hubs_.front() = std::move(hub);
  SortHubs();
}

void WayBounds::Clear() {
  hubs_.clear();
}

double WayBounds::AtMostM(std::size_t keyframe) const {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Hub& hub : hubs_)
    least_m = std::min(least_m, static_cast<double>(hub.ways_m.back()) + hub.ways_m[keyframe]);
  return least_m;
}

bool WayBounds::AllBelow(std::size_t begin, std::size_t end, double way_m) const {
  std::size_t level = 0;
  while (level + 1 < kLevels && (std::size_t{1} << (kBits * (level + 1))) < end - begin) ++level;
  if ((std::size_t{1} << (kBits * (level + 1))) < end - begin) return false;
  const std::size_t block = begin >> (kBits * (level + 1));
  for (const Hub& hub : hubs_) {
    const double to_hub_m = hub.ways_m.back();
    if (to_hub_m >= way_m) return false;
    if (to_hub_m + hub.longest_m[level][block] >= way_m) continue;
    hub.used_at = hub.ways_m.size();
    return true;
  }
  return false;
}

void WayBounds::SortHubs() {
  std::stable_sort(hubs_.begin(), hubs_.end(),
                   [](const Hub& a, const Hub& b) { return a.ways_m.back() < b.ways_m.back(); });
}

}  // namespace cairn::slam
