// The bytes of all records but the journal (records.h).
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/service/start_pose.h"
#include "server/store/record_values.h"

namespace cairn::server {
namespace {

template <typename Message>
bool Parse(Message& message, std::string_view bytes) {
  return message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

void FillPath(record::MapVersion::SmoothedPath& to, const std::string& robot, const SmoothedPath& smoothed) {
  to.set_robot(robot);
  to.set_session(smoothed.session);
  for (const StampedPose& pose : *smoothed.path) {
    to.add_stamps(pose.stamp);
    to.add_poses(pose.T_map_robot.x);
    to.add_poses(pose.T_map_robot.y);
    to.add_poses(pose.T_map_robot.theta);
  }
}

Result<std::shared_ptr<const Trajectory>> PathOf(const record::MapVersion::SmoothedPath& from) {
  if (from.poses_size() != 3 * from.stamps_size()) return Unreadable("a path");
  auto path = std::make_shared<Trajectory>();
  for (int i = 0; i < from.stamps_size(); ++i) {
    path->push_back({from.stamps(i), {from.poses(3 * i), from.poses(3 * i + 1), from.poses(3 * i + 2)}});
  }
  return path;
}

void Fill(record::Site::Edit& to, const MapEdit& edit) {
  to.set_id(edit.id);
  to.set_kind(static_cast<std::uint32_t>(edit.kind));
  for (const Eigen::Vector2d& point : edit.points_map) {
    to.add_points(point.x());
    to.add_points(point.y());
  }
  to.set_width_m(edit.width_m);
  to.set_note(edit.note);
  to.set_made(edit.made);
}

void Fill(record::Site::Edit& to, const EditAnchors& anchors) {
  for (const EditAnchor& anchor : anchors.keyframes) {
    record::Site::Edit::Anchor& added = *to.add_anchors();
    added.set_session(anchor.session);
    added.set_keyframe(anchor.keyframe);
    server::Fill(*added.mutable_then(), anchor.T_map_then);
    server::Fill(*added.mutable_now(), anchor.T_map_now);
  }
  for (const Eigen::Vector2d& point : anchors.points_then) {
    to.add_points_then(point.x());
    to.add_points_then(point.y());
  }
}

Result<MapEdit> ValueOf(const record::Site::Edit& from) {
  if (from.id() == 0 || from.points_size() % 2 != 0 || from.kind() >= static_cast<std::uint32_t>(kMapEditKindCount))
    return Unreadable("an edit of a map");
  MapEdit edit{.id = from.id(),
               .kind = static_cast<MapEditKind>(from.kind()),
               .points_map = {},
               .width_m = from.width_m(),
               .note = from.note(),
               .made = from.made()};
  for (int i = 0; i < from.points_size(); i += 2) edit.points_map.emplace_back(from.points(i), from.points(i + 1));
  if (!ValidateMapEdit(edit)) return Unreadable("an edit of a map");
  return edit;
}

Result<EditAnchors> AnchorsOf(const record::Site::Edit& from) {
  EditAnchors anchors;
  if (from.points_then_size() != from.points_size() || from.anchors_size() > static_cast<int>(kMostEditPoints))
    return Unreadable("the anchors of an edit");
  for (int i = 0; i < from.points_then_size(); i += 2)
    anchors.points_then.emplace_back(from.points_then(i), from.points_then(i + 1));
  for (const record::Site::Edit::Anchor& one : from.anchors())
    anchors.keyframes.push_back(
        {one.session(), one.keyframe(), server::ValueOf(one.then()), server::ValueOf(one.now())});
  const bool finite =
      std::ranges::all_of(anchors.points_then, [](const Eigen::Vector2d& point) { return point.allFinite(); }) &&
      std::ranges::all_of(anchors.keyframes, [](const EditAnchor& anchor) {
        return anchor.T_map_then.IsFinite() && anchor.T_map_now.IsFinite();
      });
  if (!finite) return Unreadable("the anchors of an edit");
  return anchors;
}

}  // namespace

std::string BytesOf(const StoredSession& session) {
  record::Session to;
  to.set_id(session.id);
  Fill(*to.mutable_request(), session.request);
  to.set_map_epoch(session.map_epoch);
  to.set_fragment(session.fragment);
  to.set_quiet_since_ms(session.quiet_since_ms);
  to.set_map_begun(session.map_begun);
  return to.SerializeAsString();
}

Result<StoredSession> SessionOf(std::string_view bytes) {
  record::Session from;
  if (!Parse(from, bytes)) return Unreadable("a session");
  StoredSession session{.id = from.id(),
                        .request = ValueOf(from.request()),
                        .map_epoch = from.map_epoch(),
                        .fragment = from.fragment(),
                        .quiet_since_ms = from.quiet_since_ms(),
                        .map_begun = from.map_begun()};
  const bool valid = session.id != 0 && ValidateName("robot", session.request.robot) &&
                     ValidateName("site", session.request.site) &&
                     (!session.request.has_start || ValidateStart(session.request.T_map_robot_start));
  if (!valid) return Unreadable("a session");
  return session;
}

std::string BytesOf(const StoredVersion& version) {
  record::MapVersion to;
  to.set_version(version.version);
  to.set_job(version.job);
  to.set_note(version.note);
  for (const auto& [session, grid] : version.parts) {
    record::MapVersion::Part& part = *to.add_parts();
    part.set_session(session);
    Fill(*part.mutable_grid(), grid);
  }
  for (const auto& [robot, path] : version.smoothed) FillPath(*to.add_paths(), robot, path);
  return to.SerializeAsString();
}

Result<StoredVersion> VersionOf(std::string_view bytes) {
  record::MapVersion from;
  if (!Parse(from, bytes) || from.version() == 0) return Unreadable("a map version");
  StoredVersion version;
  version.version = from.version();
  version.job = from.job();
  version.note = from.note();
  for (const record::MapVersion::Part& part : from.parts()) {
    auto grid = ValueOf(part.grid());
    if (!grid) return tl::unexpected(grid.error());
    version.parts.emplace(part.session(), std::move(*grid));
  }
  for (const record::MapVersion::SmoothedPath& one : from.paths()) {
    auto path = PathOf(one);
    if (!path) return tl::unexpected(path.error());
    version.smoothed.emplace(one.robot(), SmoothedPath{one.session(), std::move(*path)});
  }
  return version;
}

std::string BytesOf(const StoredSite& site) {
  record::Site to;
  to.set_name(site.name);
  to.set_epoch(site.epoch);
  to.set_tile_version(site.tile_version);
  to.set_next_version(site.next_version);
  to.set_enabled_version(site.enabled_version);
  for (const auto& [epoch, generation] : site.switches) {
    record::Site::Switch& made = *to.add_switches();
    made.set_epoch(epoch);
    made.set_generation(generation);
  }
  for (const auto& [robot_id, session] : site.members) {
    record::Site::Member& member = *to.add_members();
    member.set_robot_id(robot_id);
    member.set_session(session);
  }
  to.set_resolution_m(site.resolution_m);
  for (const std::uint64_t session : site.fragments) to.add_fragments(session);
  for (const std::uint64_t session : site.past) to.add_past(session);
  for (const std::uint64_t session : site.merged) to.add_merged(session);
  to.set_map_frame(site.map_frame);
  for (const MapEdit& edit : site.edits) {
    record::Site::Edit& added = *to.add_edits();
    Fill(added, edit);
    const auto anchors = site.anchors.find(edit.id);
    if (anchors != site.anchors.end() && !anchors->second.keyframes.empty()) Fill(added, anchors->second);
  }
  to.set_edits_version(site.edits_version);
  if (site.given_up.versions > 0 || site.given_up.layers > 0 || site.given_up.sessions > 0) {
    to.mutable_given_up()->set_versions(site.given_up.versions);
    to.mutable_given_up()->set_layers(site.given_up.layers);
    to.mutable_given_up()->set_sessions(site.given_up.sessions);
  }
  to.set_chosen(site.chosen);
  for (const std::uint64_t session : site.kept_apart) to.add_kept_apart(session);
  return to.SerializeAsString();
}

Result<StoredSite> SiteOf(std::string_view bytes) {
  record::Site from;
  if (!Parse(from, bytes) || !ValidateName("site", from.name())) return Unreadable("a site");
  if (from.enabled_version() == 0 || from.enabled_version() >= from.next_version()) return Unreadable("a site");
  StoredSite site{.name = from.name(),
                  .epoch = from.epoch(),
                  .tile_version = from.tile_version(),
                  .next_version = from.next_version(),
                  .enabled_version = from.enabled_version(),
                  .switches = {},
                  .members = {},
                  .resolution_m = from.resolution_m(),
                  .fragments = {from.fragments().begin(), from.fragments().end()},
                  .past = {from.past().begin(), from.past().end()},
                  .merged = {from.merged().begin(), from.merged().end()},
                  .map_frame = from.map_frame(),
                  .edits = {},
                  .edits_version = from.edits_version(),
                  .given_up = {.versions = from.given_up().versions(),
                               .layers = from.given_up().layers(),
                               .sessions = from.given_up().sessions()},
                  .chosen = from.chosen(),
                  .kept_apart = {from.kept_apart().begin(), from.kept_apart().end()}};
  if (!(site.resolution_m >= 0.0 && site.resolution_m <= 10.0)) return Unreadable("a site");
  for (const auto& made : from.switches()) site.switches[made.epoch()] = made.generation();
  for (const auto& member : from.members()) site.members[member.robot_id()] = member.session();
  const auto edits = static_cast<std::uint64_t>(from.edits_size());
  if (edits > kMostStoredEdits || from.edits_version() >= kMaxEditsVersion - edits) return Unreadable("a site");
  for (const record::Site::Edit& one : from.edits()) {
    auto edit = ValueOf(one);
    if (!edit) return tl::unexpected(edit.error());
    if (edit->id > site.edits_version || (!site.edits.empty() && edit->id <= site.edits.back().id))
      return Unreadable("a site");
    if (one.anchors_size() > 0) {
      auto anchors = AnchorsOf(one);
      if (!anchors) return tl::unexpected(anchors.error());
      site.anchors.emplace(edit->id, *std::move(anchors));
    }
    site.edits.push_back(*std::move(edit));
  }
  return site;
}

std::string BytesOf(const StoredLayer& layer) {
  record::Layer to;
  to.set_session(layer.session);
  Fill(*to.mutable_grid(), layer.grid);
  return to.SerializeAsString();
}

Result<StoredLayer> LayerOf(std::string_view bytes) {
  record::Layer from;
  if (!Parse(from, bytes)) return Unreadable("a part of a map");
  auto grid = ValueOf(from.grid());
  if (!grid) return tl::unexpected(grid.error());
  return StoredLayer{from.session(), std::move(*grid)};
}

std::string BytesOf(const StoredJob& stored) {
  const Job& job = stored.job;
  record::Job to;
  to.set_id(job.id);
  to.set_site(job.site);
  to.set_kind(static_cast<std::uint32_t>(job.kind));
  to.set_state(static_cast<std::uint32_t>(job.state));
  to.set_progress(job.progress);
  to.set_cost_before(job.cost_before);
  to.set_cost_after(job.cost_after);
  to.set_map_version(job.map_version);
  to.set_submitted(job.submitted);
  to.set_started(job.started);
  to.set_ended(job.ended);
  to.set_message(job.message);
  to.set_enable(stored.enable);
  to.set_attempts(stored.attempts);
  to.set_robot(job.robot);
  for (const PoseHypothesis& place : job.places) {
    record::Job::Place& added = *to.add_places();
    added.set_stamp(place.stamp);
    Fill(*added.mutable_t_map_robot(), place.T_map_robot);
    added.set_weight(place.weight);
  }
  return to.SerializeAsString();
}

Result<StoredJob> JobOf(std::string_view bytes) {
  record::Job from;
  if (!Parse(from, bytes) || from.id() == 0) return Unreadable("a job");
  if (from.kind() > static_cast<std::uint32_t>(JobKind::kRelocalise)) return Unreadable("a job");
  if (from.state() > static_cast<std::uint32_t>(JobState::kCancelled)) return Unreadable("a job");
  StoredJob stored;
  Job& job = stored.job;
  job.id = from.id();
  job.site = from.site();
  job.kind = static_cast<JobKind>(from.kind());
  job.state = static_cast<JobState>(from.state());
  job.progress = from.progress();
  job.cost_before = from.cost_before();
  job.cost_after = from.cost_after();
  job.map_version = from.map_version();
  job.submitted = from.submitted();
  job.started = from.started();
  job.ended = from.ended();
  job.message = from.message();
  stored.enable = from.enable();
  stored.attempts = from.attempts();
  job.robot = from.robot();
  if (from.places_size() > static_cast<int>(kMostHypotheses)) return Unreadable("a job");
  for (const record::Job::Place& place : from.places())
    job.places.push_back({place.stamp(), ValueOf(place.t_map_robot()), place.weight()});
  return stored;
}

}  // namespace cairn::server
