#include "server/jobs/joiner.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/ops/log_context.h"

namespace cairn::server {
namespace {

// Ratio of the ways driven until the next job and until the last one. A robot that is not joined drives without a map
// of its site, and a job that joins nothing is short.
constexpr double kJoinAgainAfter = 1.1;
constexpr double kFitAgainAfter = 1.25;
// A tenth or a quarter of all that was ever driven is days of driving, after days. So one robot that has driven this
// far is reason enough, too: four to seven minutes at the speed of an indoor robot, in which it has been round a floor
// of 60 x 40 m. A job measures only what is new, at most three seconds per hundred metres and pair of robots, so even
// with eight robots it takes a quarter of the time that the way did.
constexpr double kFarthestBetweenM = 200.0;

// Whether `now` is that far behind `before`. What was not there before has driven nothing.
bool HasDrivenFar(const std::map<SessionId, double>& before, const std::map<SessionId, double>& now) {
  return std::ranges::any_of(now, [&before](const auto& one) {
    const auto then = before.find(one.first);
    return one.second - (then == before.end() ? 0.0 : then->second) >= kFarthestBetweenM;
  });
}

}  // namespace

void Joiner::Tick() {
  if (!options_.joint) return;
  auto sites = Look();
  std::erase_if(tried_, [&sites](const auto& one) { return !sites.contains(one.first); });
  for (auto& [site, driven] : sites) {
    const LogContext context(AboutSite(site));
    if ((!IsDue(site, driven) && !IsDueToAlign(site, driven)) || HasWork(site) ||
        jobs_.EndsServers(site, JobKind::kJoin))
      continue;
    if (const auto job = worker_.Submit(site, JobKind::kJoin, true); !job)
      spdlog::warn("site {}: no job to join its robots could be submitted: {}", site, job.error().message);
    // One that has not driven far enough was not tried.
    std::erase_if(driven.fragments, [this](const auto& one) { return one.second < options_.join_way_m; });
    tried_[site] = std::move(driven);
  }
}

std::map<std::string, Joiner::Driven> Joiner::Look() const {
  std::map<std::string, Driven> sites;
  for (const auto& session : roster_.All()) {
    const SessionRecord::Joining joining = session->record().joining();
    const std::string name = session->record().state().site;
    Driven& driven = sites[name];
    if (!joining.fragment || !joining.joinable) continue;
    const auto site = atlas_.Find(name);
    if (site == nullptr || !site->kept_apart().contains(session->id()))
      driven.fragments.emplace(session->id(), joining.driven_m);
  }
  for (auto& [site, driven] : sites) {
    for (const auto& session : roster_.InSite(site)) {  // Earlier ones too.
      const SessionRecord::Joining joining = session->record().joining();
      if (joining.fragment) continue;
      driven.others_m += joining.driven_m;
      if (!joining.joinable || joining.driven_m < options_.join_way_m) continue;
      ++driven.far;
      if (session->record().phase() != SessionPhase::kEnded) driven.today.emplace(session->id(), joining.driven_m);
    }
  }
  return sites;
}

bool Joiner::IsDueToAlign(const std::string& name, const Driven& now) const {
  if (!options_.align || now.far < 2 || now.today.empty()) return false;
  const auto tried = tried_.find(name);
  // A second one that has driven far enough by now is new.
  const bool more = tried == tried_.end() || now.others_m >= kFitAgainAfter * tried->second.others_m ||
                    now.far > tried->second.far || HasDrivenFar(tried->second.today, now.today);
  const auto site = more ? atlas_.Find(name) : nullptr;
  return site != nullptr && site->MayBeAligned();
}

bool Joiner::IsDue(const std::string& site, const Driven& now) const {
  if (!options_.join || now.others_m < options_.join_way_m) return false;
  const auto tried = tried_.find(site);
  return std::ranges::any_of(now.fragments, [&](const auto& fragment) {
    const auto& [session, driven_m] = fragment;
    if (driven_m < options_.join_way_m) return false;
    if (tried == tried_.end()) return true;
    const auto before = tried->second.fragments.find(session);
    return before == tried->second.fragments.end() ||
           driven_m >= kJoinAgainAfter * std::max(before->second, options_.join_way_m) ||
           driven_m >= std::max(before->second, options_.join_way_m) + kFarthestBetweenM ||
           now.others_m >= kJoinAgainAfter * tried->second.others_m || HasDrivenFar(tried->second.today, now.today);
  });
}

bool Joiner::HasWork(const std::string& site) const {
  return std::ranges::any_of(jobs_.OfSite(site), [](const Job& job) { return !IsFinal(job.state) && !OnlyLooks(job); });
}

}  // namespace cairn::server
