#include "server/jobs/smooth_job.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/bounded_channel.h"
#include "server/jobs/alignment.h"
#include "server/slam/site/site_smoothing.h"
#include "server/slam/smoothing/smoothed_map.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;
// A waiting job checks this often whether it was cancelled or its time has passed.
constexpr auto kLook = std::chrono::milliseconds(50);

// Only the first call succeeds: that of the site, which then begins the switch, or that of the job, which then gives
// the switch up.
class Decision {
 public:
  bool Take() { return !taken_.exchange(true); }

 private:
  std::atomic<bool> taken_ = false;
};

constexpr double kShareOfJoining = 0.5;  // Of the progress.
constexpr double kWrongPlaceM = 5.0;

// Nothing: cancelled.
std::optional<std::vector<slam::SmoothedSession>> SmoothTogether(const std::vector<SessionMaterial>& material,
                                                                 const slam::SiteOptions& site, JobKind kind,
                                                                 const JobControl& control, slam::RelationBook* book,
                                                                 bool align) {
  std::vector<slam::SiteSession> sessions;
  sessions.reserve(material.size());
  for (const SessionMaterial& session : material)
    sessions.push_back({session.snapshot, session.start_known, session.session, session.start_found});
  const auto go_on = [&control](double share) {
    control.Progress(kShareOfJoining * share);
    return !control.cancelled();
  };
  const slam::SiteSearch joins = align ? slam::SiteSearch::kRobots : slam::SiteSearch::kFragments;
  return slam::SmoothSessions(sessions, site, go_on, kind == JobKind::kJoin ? joins : slam::SiteSearch::kAll, book);
}

// For each session, whether it is shown: its place in the map is known, or it is joined with one whose place is known
// and can continue there.
std::vector<bool> Shown(const std::vector<SessionMaterial>& material, const std::vector<slam::SmoothedSession>& joint) {
  const auto frame_of = [&joint](std::size_t i) { return joint[i].joined ? joint[i].frame : i; };
  std::set<std::size_t> frames;
  for (std::size_t i = 0; i < material.size(); ++i) {
    if (material[i].start_known) frames.insert(frame_of(i));
  }
  std::vector<bool> shown(material.size());
  for (std::size_t i = 0; i < material.size(); ++i)
    shown[i] = frames.contains(frame_of(i)) && (material[i].start_known || material[i].joinable);
  return shown;
}

bool JoinsAny(const std::vector<SessionMaterial>& material, const std::vector<bool>& shown) {
  for (std::size_t i = 0; i < material.size(); ++i) {
    if (shown[i] && !material[i].start_known) return true;
  }
  return false;
}

std::string Counts(const std::vector<SessionMaterial>& material) {
  std::set<std::string> robots;
  for (const SessionMaterial& session : material) robots.insert(session.robot);
  std::string counts = std::to_string(robots.size()) + (robots.size() == 1 ? " robot" : " robots");
  if (robots.size() < material.size()) counts += " in " + std::to_string(material.size()) + " sessions";
  return counts;
}

// What a person wants to know of the joint smoothing: at most as many robots as fit on a line. A robot that said where
// it starts is in the map also where nothing joins it with others.
std::string Joins(const std::vector<SessionMaterial>& material, const std::vector<slam::SmoothedSession>& joint) {
  constexpr int kMostNamed = 4;
  std::string together, placed, apart;
  int joined = 0, by_start = 0, alone = 0;
  const auto part = [](std::string_view what, int count, const std::string& names) {
    return count == 0 ? std::string() : "; " + std::string(what) + " " + std::to_string(count) + ": " + names;
  };
  for (std::size_t i = 0; i < material.size(); ++i) {
    if (joint[i].path.empty()) continue;
    if (joint[i].joined) {
      if (++joined > kMostNamed) continue;
      together += (together.empty() ? "" : ", ") + material[i].robot + " (" + std::to_string(joint[i].relations) +
                  " relations, " + std::to_string(std::lround(100.0 * joint[i].agreement)) + " % agrees" +
                  (material[i].start_known || material[i].joinable ? ")" : "; its filter cannot continue there)");
    } else if (material[i].start_known) {
      if (++by_start <= kMostNamed) placed += (placed.empty() ? "" : ", ") + material[i].robot;
    } else if (++alone <= kMostNamed) {
      apart += (apart.empty() ? "" : ", ") + material[i].robot;
    }
  }
  return part("joined", joined, together) + part("placed by their known starts alone", by_start, placed) +
         part("not joined", alone, apart);
}

// How far the session goes that was joined farthest from where it is now known to be.
double FarthestFromPlace(const std::vector<SessionMaterial>& material,
                         const std::vector<slam::SmoothedSession>& joint) {
  double farthest_m = 0.0;
  for (std::size_t i = 0; i < material.size(); ++i) {
    if (!material[i].start_found || !joint[i].joined || !material[joint[i].frame].start_known) continue;
    if (material[i].snapshot.online_path.empty() || joint[i].path.empty()) continue;
    const Eigen::Vector2d before = material[i].snapshot.online_path.front().translation();
    farthest_m = std::max(farthest_m, (joint[i].path.front().translation() - before).norm());
  }
  return farthest_m;
}

std::string Moves(const Alignment& alignment) {
  return "; moved by up to " + std::to_string(std::lround(100.0 * alignment.moved_m)) +
         " cm, so that scans are off the maps of others by " +
         std::to_string(std::lround(1000.0 * std::sqrt(alignment.after_m2))) + " instead of " +
         std::to_string(std::lround(1000.0 * std::sqrt(alignment.before_m2))) + " mm";
}

}  // namespace

Result<SmoothedSite> SmoothSite(const Job& job, const std::vector<SessionMaterial>& material,
                                const slam::SiteOptions* site, const JobControl& control, slam::RelationBook* book,
                                bool align, KeptDrawings::OfSite* drawings) {
  std::size_t keyframes = 0, scans = 0;
  for (const SessionMaterial& session : material) {
    keyframes += session.snapshot.keyframes.size();
    scans += session.snapshot.scans.size();
  }
  if (keyframes == 0) return Fail(StatusCode::kFailedPrecondition, "site '" + job.site + "' has no scans to smooth");

  const bool together = site != nullptr && material.size() > 1;
  std::vector<slam::SmoothedSession> joint(material.size());
  if (together) {
    auto smoothed = SmoothTogether(material, *site, job.kind, control, book, align);
    if (!smoothed) return Fail(StatusCode::kCancelled, "cancelled");
    joint = *std::move(smoothed);
  }
  const std::vector<bool> shown = Shown(material, joint);
  std::string summary =
      Counts(material) + ", " + std::to_string(keyframes) + " keyframes, " + std::to_string(scans) + " scans";
  if (together) summary += Joins(material, joint);
  if (together && book != nullptr)
    summary += "; relations measured " + std::to_string(book->measured()) + ", known from before " +
               std::to_string(book->reused());
  const auto go_on = [&control] { return !control.cancelled(); };
  SmoothedSite smoothed;
  if (job.kind == JobKind::kJoin && !JoinsAny(material, shown)) {
    const auto alignment = align ? AlignmentOf(material, joint, go_on) : Alignment{};
    if (!alignment) return Fail(StatusCode::kCancelled, "cancelled");
    // No path is off by so much: it was joined at a wrong place. Its map may agree as well there, so that does not
    // count.
    const double elsewhere_m = align ? FarthestFromPlace(material, joint) : 0.0;
    const bool was_wrong = elsewhere_m > kWrongPlaceM;
    smoothed.aligns = alignment->IsBetter() || was_wrong;
    if (!smoothed.aligns) {
      smoothed.outcome.message = "nothing to join yet: " + summary;
      return smoothed;
    }
    summary += Moves(*alignment);
    if (was_wrong) summary += "; a robot was joined " + std::to_string(std::lround(elsewhere_m)) + " m from its place";
  }
  // The rest of the progress is the share of scans drawn and compared.
  const double begun = together ? kShareOfJoining : 0.0;
  std::size_t steps = 0, done = 0;
  for (std::size_t i = 0; i < material.size(); ++i)
    steps += slam::SmoothingSteps(material[i].snapshot, joint[i].joined);
  const auto next = [&] {
    control.Progress(begun + (1.0 - begun) * static_cast<double>(done++) / static_cast<double>(steps));
    return !control.cancelled();
  };
  slam::Disagreement before, after;
  MapVersion version;
  version.info.job = job.id;
  for (std::size_t i = 0; i < material.size(); ++i) {
    const SessionMaterial& session = material[i];
    const slam::MapperSnapshot& snapshot = session.snapshot;
    slam::DrawnMaps* const drawn = drawings == nullptr ? nullptr : &(*drawings)[session.session];
    auto map = joint[i].joined ? slam::MapAlong(snapshot, joint[i].path, session.grid_options, next, drawn)
                               : slam::SmoothMap(snapshot, session.grid_options, next, go_on, drawn);
    if (!map) return Fail(StatusCode::kCancelled, "cancelled");
    before.Add(map->before);
    after.Add(map->after);
    if (shown[i])
      version.smoothed[session.robot] = {session.session,
                                         std::make_shared<const Trajectory>(snapshot.TrajectoryAlong(map->path))};
    version.parts[session.session] = {.chunks = map->grid.Share(),
                                      .keyframes = snapshot.made(),
                                      .path = std::make_shared<const std::vector<Pose2>>(std::move(map->path)),
                                      .numbers = std::make_shared<const std::vector<std::uint64_t>>(snapshot.numbers),
                                      .fragment = !shown[i]};
  }
  version.info.note = "smoothed: " + summary;
  smoothed.version = std::move(version);
  smoothed.outcome = {
      .cost_before = before.mean_m2(), .cost_after = after.mean_m2(), .map_version = 0, .message = summary};
  return smoothed;
}

bool SmoothJob::MayAlign(const Job& job) const {
  const auto site = atlas_.Find(job.site);
  if (!options_.align || job.kind != JobKind::kJoin || site == nullptr || !site->MayBeAligned()) return false;
  if (jobs_ == nullptr) return true;
  return std::ranges::none_of(jobs_->OfSite(job.site), [&job](const Job& other) {
    return other.id != job.id && !IsFinal(other.state) && !OnlyLooks(other);
  });
}

std::set<SessionId> SmoothJob::KeptApart(const std::string& name) const {
  const auto site = atlas_.Find(name);
  return site == nullptr ? std::set<SessionId>{} : site->kept_apart();
}

Result<SmoothedSite> SmoothJob::Smooth(const Job& job, const std::vector<SessionMaterial>& material,
                                       const JobControl& control) {
  std::vector<std::uint64_t> sessions;
  sessions.reserve(material.size());
  for (const SessionMaterial& one : material) sessions.push_back(one.session);
  slam::RelationBook& book = books_.Open(job.site, sessions);
  aligned_.KeepOnly([this](const std::string& site) { return atlas_.Find(site) != nullptr; });
  const bool align = MayAlign(job) && aligned_.IsDue(job.site, material);
  auto smoothed =
      SmoothSite(job, material, options_.joint ? &site_ : nullptr, control, &book, align, &drawings_.Open(job.site));
  // Also where the job was cancelled: what it has measured and drawn holds.
  const auto site_exists = [this](const std::string& site) { return atlas_.Find(site) != nullptr; };
  books_.Close(job.site, sessions, site_exists);
  drawings_.Close(job.site, sessions, site_exists);
  return smoothed;
}

Result<JobOutcome> SmoothJob::Run(const Job& job, bool enable, const JobControl& control) {
  auto material = Collect(job.site, control);
  if (!material) return tl::unexpected(material.error());
  if (job.kind == JobKind::kJoin) {
    std::erase_if(*material, [apart = KeptApart(job.site)](const SessionMaterial& one) {
      return !one.start_known && apart.contains(one.session);
    });
  }
  auto smoothed = Smooth(job, *material, control);
  if (!smoothed) return tl::unexpected(smoothed.error());
  JobOutcome outcome = std::move(smoothed->outcome);
  if (!smoothed->version) return outcome;
  // It took long; a person may have come meanwhile.
  if ((smoothed->aligns && !MayAlign(job)) ||
      (job.kind == JobKind::kJoin && JoinsOneOf(KeptApart(job.site), *smoothed->version))) {
    outcome.message = "given up for the sake of a person's wish: " + outcome.message;
    return outcome;
  }
  const auto number = Await(job.site, control, [&](Site& site, Site::Done done, Site::Wanted wanted) {
    site.AddVersion(*std::move(smoothed->version), std::move(done), std::move(wanted));
  });
  if (!number) return tl::unexpected(number.error());
  outcome.map_version = *number;
  if (!enable || control.cancelled()) return outcome;
  const auto joins = job.kind == JobKind::kJoin ? Site::EnabledBy::kJoin : Site::EnabledBy::kJob;
  const auto by = smoothed->aligns ? Site::EnabledBy::kAlignment : joins;
  const auto enable_it = [version = *number, by](Site& site, Site::Done done, Site::Wanted wanted) {
    site.Enable(version, std::move(done), std::move(wanted), by);
  };
  const auto enabled = Await(job.site, control, enable_it);
  if (!enabled) return tl::unexpected(enabled.error());
  return outcome;
}

Result<std::vector<SessionMaterial>> SmoothJob::Collect(const std::string& site, const JobControl& control) const {
  const auto sessions = roster_.InSite(site);
  const auto answers = std::make_shared<BoundedChannel<SessionMaterial>>(std::max<std::size_t>(1, sessions.size()));
  for (const auto& session : sessions) {
    // If the session's queue is full, it does not answer, and the job fails at the deadline.
    static_cast<void>(session->Post(SnapshotWanted{
        [answers](SessionMaterial&& material) { static_cast<void>(answers->TryPush(std::move(material))); }}));
  }
  const auto deadline = Clock::now() + std::chrono::duration<double>(options_.snapshot_timeout_s);
  std::map<SessionId, SessionMaterial> material;  // Ordered by id: the result must not depend on the order of answers.
  while (material.size() < sessions.size()) {
    if (control.cancelled()) return Fail(StatusCode::kCancelled, "cancelled");
    if (Clock::now() > deadline) {
      return Fail(StatusCode::kDeadlineExceeded,
                  std::to_string(sessions.size() - material.size()) +
                      " robots did not hand over their state in time (jobs.snapshot_timeout_s)");
    }
    if (auto answer = answers->PopFor(kLook)) {
      const SessionId session = answer->session;
      material.emplace(session, *std::move(answer));
    }
  }
  std::vector<SessionMaterial> all;
  all.reserve(material.size());
  for (auto& [id, one] : material) all.push_back(std::move(one));
  return all;
}

Result<std::uint32_t> SmoothJob::Await(const std::string& name, const JobControl& control, const Ask& ask) const {
  const auto site = atlas_.Find(name);
  if (site == nullptr) return Fail(StatusCode::kNotFound, "no site '" + name + "'");
  const auto promise = std::make_shared<std::promise<Result<std::uint32_t>>>();
  auto answer = promise->get_future();
  const auto decision = std::make_shared<Decision>();
  ask(
      *site, [promise](Result<std::uint32_t> result) { promise->set_value(std::move(result)); },
      [decision] { return decision->Take(); });
  const auto timeout = std::chrono::duration<double>(options_.snapshot_timeout_s);
  const auto deadline = Clock::now() + timeout;
  std::optional<Clock::time_point> cancelled;
  while (answer.wait_for(kLook) != std::future_status::ready) {
    const auto now = Clock::now();
    if (control.cancelled() && !cancelled) cancelled = now;
    if (cancelled && decision->Take()) return Fail(StatusCode::kCancelled, "cancelled");
    if (now > deadline && decision->Take()) {
      return Fail(StatusCode::kDeadlineExceeded, "the site did not answer in time (jobs.snapshot_timeout_s)");
    }
    if (cancelled && now > *cancelled + timeout) {
      return Fail(StatusCode::kCancelled,
                  "cancelled while the site was at work; it may still complete the new version");
    }
  }
  return answer.get();
}

}  // namespace cairn::server
