// What the last smoothing job of each site drew, so that the next one draws only what has changed
// (slam/smoothing/drawn_map.h). It is kept in memory only: the first job of a server draws everything. If all drawings
// together take more than `most_bytes`, those of sites whose last job is the longest ago are forgotten. Chunks that
// have not changed are shared with the map version of the last job. Thread rule: one thread (the job worker's).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "server/slam/smoothing/drawn_map.h"

namespace cairn::server {

class KeptDrawings {
 public:
  using OfSite = std::map<std::uint64_t, slam::DrawnMaps>;  // By session.

  static constexpr std::size_t kMostBytes = std::size_t{256} << 20;
  explicit KeptDrawings(std::size_t most_bytes = kMostBytes) : most_bytes_(most_bytes) {}

  // The drawings of a site, which its job changes until Close.
  OfSite& Open(const std::string& site);
  // `sessions`: those that there are; drawings of others are forgotten. `site_exists`: drawings of other sites are
  // forgotten.
  void Close(const std::string& site, const std::vector<std::uint64_t>& sessions,
             const std::function<bool(const std::string& site)>& site_exists);

  [[nodiscard]] std::size_t Bytes() const;

 private:
  struct Site {
    OfSite drawings;
    std::uint64_t job = 0;  // Count of the jobs before its last one.
  };

  const std::size_t most_bytes_;
  std::uint64_t jobs_ = 0;
  std::map<std::string, Site> sites_;
};

}  // namespace cairn::server
