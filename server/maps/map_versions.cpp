#include "server/maps/map_versions.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace cairn::server {

bool JoinsOneOf(const std::set<SessionId>& sessions, const MapVersion& version) {
  return std::ranges::any_of(
      version.parts, [&sessions](const auto& part) { return !part.second.fragment && sessions.contains(part.first); });
}

MapVersions::MapVersions(std::size_t max_versions) : max_versions_(max_versions) {
  versions_[1].info = {.version = 1, .enabled = true, .job = 0, .note = "live"};
}

std::uint32_t MapVersions::Add(MapVersion version, std::uint32_t wanted) {
  const std::uint32_t number = next_++;
  version.info.version = number;
  version.info.enabled = false;
  versions_.emplace(number, std::move(version));
  for (auto it = versions_.begin(); versions_.size() > max_versions_ && it != versions_.end();) {
    const bool needed = it->first == 1 || it->first == enabled_ || it->first == wanted || it->first == number;
    it = needed ? std::next(it) : versions_.erase(it);
  }
  return number;
}

const MapVersion* MapVersions::Find(std::uint32_t version) const {
  const auto found = versions_.find(version);
  return found == versions_.end() ? nullptr : &found->second;
}

std::vector<std::uint32_t> MapVersions::Enable(std::uint32_t version, const std::map<SessionId, RobotGrid>& displaced) {
  MapVersion& outgoing = versions_.at(enabled_);
  std::vector<std::uint32_t> changed;
  for (auto& [number, other] : versions_) {
    if (number == enabled_) continue;
    const std::map<SessionId, RobotGrid>& missing = number == version ? outgoing.parts : displaced;
    const std::size_t before = other.parts.size();
    other.parts.insert(missing.begin(), missing.end());  // Parts that it has stay.
    if (other.parts.size() != before) changed.push_back(number);
  }
  for (const auto& [session, part] : displaced) outgoing.parts.insert_or_assign(session, part);
  changed.push_back(enabled_);
  outgoing.info.enabled = false;
  enabled_ = version;
  versions_.at(version).info.enabled = true;
  return changed;
}

std::optional<std::uint32_t> MapVersions::LeastNeeded(bool last) const {
  const auto enabled = versions_.find(enabled_);
  const std::uint32_t before = enabled == versions_.begin() ? 0 : std::prev(enabled)->first;
  const std::uint32_t newest = versions_.rbegin()->first;
  for (const auto& [number, version] : versions_) {
    if (number != enabled_ && number != before && number != newest) return number;
  }
  if (last && newest != enabled_) return newest;
  if (last && before != 0) return before;
  return std::nullopt;
}

SessionId MapVersions::LastSession() const {
  SessionId last = 0;
  for (const auto& [number, version] : versions_)
    if (!version.parts.empty()) last = std::max(last, version.parts.rbegin()->first);
  return last;
}

std::vector<std::uint32_t> MapVersions::MergeParts(SessionId older, SessionId later, const Merge& merge) {
  std::vector<std::uint32_t> changed;
  for (auto& [number, version] : versions_) {
    const auto first = version.parts.find(older), second = version.parts.find(later);
    const auto none = version.parts.end();
    if (first == none && second == none) continue;
    RobotGrid merged;
    merged.chunks = merge(first == none ? nullptr : &first->second, second == none ? nullptr : &second->second);
    if (first != none) version.parts.erase(first);
    version.parts.insert_or_assign(later, std::move(merged));
    changed.push_back(number);
  }
  return changed;
}

void MapVersions::Restore(std::map<std::uint32_t, MapVersion> versions, std::uint32_t next, std::uint32_t enabled) {
  versions_ = std::move(versions);
  next_ = next;
  enabled_ = enabled;
  for (auto& [number, version] : versions_) version.info.enabled = number == enabled;
}

std::vector<MapVersionInfo> MapVersions::infos() const {
  std::vector<MapVersionInfo> infos;
  for (const auto& [number, version] : versions_) infos.push_back(version.info);
  return infos;
}

const SmoothedPaths& MapVersions::smoothed() const {
  const SmoothedPaths& of_enabled = versions_.at(enabled_).smoothed;
  if (!of_enabled.empty()) return of_enabled;
  for (auto it = versions_.rbegin(); it != versions_.rend(); ++it) {
    if (!it->second.smoothed.empty()) return it->second.smoothed;
  }
  return of_enabled;
}

void MapVersions::Count(MemoryCount& memory) const {
  for (const auto& [number, version] : versions_) {
    for (const auto& [session, part] : version.parts) {
      for (const auto& [key, chunk] : part.chunks) memory.Add(chunk, sizeof(slam::GridChunk));
      if (part.path != nullptr) memory.Add(part.path, part.path->size() * sizeof(Pose2));
      if (part.drawn != nullptr) memory.Add(part.drawn, part.drawn->size() * sizeof(Pose2));
      if (part.numbers != nullptr) memory.Add(part.numbers, part.numbers->size() * sizeof(std::uint64_t));
    }
    for (const auto& [robot, smoothed] : version.smoothed)
      if (smoothed.path != nullptr) memory.Add(smoothed.path, smoothed.path->size() * sizeof(StampedPose));
  }
}

}  // namespace cairn::server
