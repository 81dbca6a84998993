// The bytes of a batch of journal entries (records.h).
#include <utility>

#include "common/service/start_pose.h"
#include "server/store/record_values.h"

namespace cairn::server {
namespace {

void FillEntry(record::Entry& to, const ScanTaken& from) {
  record::Scan& scan = *to.mutable_scan();
  Fill(*scan.mutable_stream(), from.stream);
  scan.set_sequence(from.scan->sequence);
  scan.set_stamp(from.scan->stamp);
  scan.set_angle_first_rad(from.scan->angle_first_rad);
  scan.set_angle_step_rad(from.scan->angle_step_rad);
  scan.set_range_min_m(from.scan->range_min_m);
  scan.set_range_max_m(from.scan->range_max_m);
  scan.set_beam_period_s(from.scan->beam_period_s);
  scan.set_tilt_rad(from.scan->tilt_rad);
  Fill(*scan.mutable_t_robot_laser(), from.scan->T_robot_laser);
  scan.mutable_ranges_m()->Add(from.scan->ranges_m.begin(), from.scan->ranges_m.end());
}

void FillEntry(record::Entry& to, const ScanRefused& from) {
  record::RefusedScan& refused = *to.mutable_refused();
  Fill(*refused.mutable_stream(), from.stream);
  refused.set_sequence(from.sequence);
  refused.set_reason(static_cast<std::uint32_t>(from.reason));
}

void FillEntry(record::Entry& to, const OdometryTaken& from) {
  record::Odometry& odometry = *to.mutable_odometry();
  Fill(*odometry.mutable_stream(), from.stream);
  odometry.set_sequence(from.odometry.sequence);
  odometry.set_stamp(from.odometry.stamp);
  Fill(*odometry.mutable_t_odom_robot(), from.odometry.T_odom_robot);
  odometry.set_use(static_cast<std::uint32_t>(from.use));
}

void FillEntry(record::Entry& to, const OwnerChanged& from) {
  to.mutable_owner()->set_client(from.client);
  to.mutable_owner()->set_session(from.session);
  for (const std::string& sensor : from.sensors) to.mutable_owner()->add_sensors(sensor);
}

void FillEntry(record::Entry& to, const CorrectionTaken& from) {
  to.mutable_correction()->set_epoch(from.epoch);
  to.mutable_correction()->set_generation(from.generation);
  Fill(*to.mutable_correction()->mutable_grid(), from.grid);
}

void FillEntry(record::Entry& to, const EpochChanged& from) {
  to.mutable_epoch()->set_epoch(from.epoch);
}

void FillEntry(record::Entry& to, const RelocaliseTaken& from) {
  record::Relocalise& relocalise = *to.mutable_relocalise();
  if (from.T_map_robot) Fill(*relocalise.mutable_t_map_robot(), *from.T_map_robot);
}

void FillMap(record::Localise& localise, const LocaliseTaken& from) {
  for (const auto& tile : from.tiles) {
    record::Localise::Tile& added = *localise.add_tiles();
    added.set_x(tile->key.x);
    added.set_y(tile->key.y);
    added.set_encoding(static_cast<std::uint32_t>(tile->encoding));
    added.set_cells(tile->bytes.data(), tile->bytes.size());
  }
  localise.set_resolution_m(from.resolution_m);
  localise.set_epoch(from.epoch);
  localise.set_maps_again(from.maps_again);
}

void FillEntry(record::Entry& to, const LocaliseTaken& from) {
  FillMap(*to.mutable_localise(), from);
}

void FillEntry(record::Entry& to, const PlaceSuggested& from) {
  record::PlaceSuggested& suggested = *to.mutable_place_suggested();
  suggested.set_seen(from.seen);
  Fill(*suggested.mutable_t_map_robot(), from.T_map_robot);
  FillMap(*suggested.mutable_map(), from.map);
}

void FillEntry(record::Entry& to, const StartRefusal& from) {
  to.mutable_start_refusal()->set_why(from.why);
}

void FillEntry(record::Entry& to, const SessionFinished& from) {
  to.mutable_finish()->set_final(from.final);
  Fill(*to.mutable_finish()->mutable_status(), from.status);
}

Result<JournalEntry> ScanOf(const record::Scan& from) {
  auto scan = std::make_shared<Scan>();
  scan->sequence = from.sequence();
  scan->stamp = from.stamp();
  scan->angle_first_rad = from.angle_first_rad();
  scan->angle_step_rad = from.angle_step_rad();
  scan->range_min_m = from.range_min_m();
  scan->range_max_m = from.range_max_m();
  scan->beam_period_s = from.beam_period_s();
  scan->tilt_rad = from.tilt_rad();
  scan->T_robot_laser = ValueOf(from.t_robot_laser());
  scan->ranges_m.assign(from.ranges_m().begin(), from.ranges_m().end());
  // The estimator relies on it.
  if (!ValidateScan(*scan)) return Unreadable("a scan");
  return ScanTaken{ValueOf(from.stream()), std::move(scan)};
}

Result<JournalEntry> OdometryOf(const record::Odometry& from) {
  const OdometryTaken taken{
      ValueOf(from.stream()),
      {.sequence = from.sequence(), .stamp = from.stamp(), .T_odom_robot = ValueOf(from.t_odom_robot())},
      static_cast<OdometryUse>(from.use())};
  if (from.use() > static_cast<std::uint32_t>(OdometryUse::kMerged)) return Unreadable("odometry");
  if (taken.use == OdometryUse::kTaken && !ValidateOdometry(taken.odometry)) return Unreadable("odometry");
  return taken;
}

Result<JournalEntry> CorrectionOf(const record::Correction& from) {
  auto grid = ValueOf(from.grid());
  if (!grid) return tl::unexpected(grid.error());
  return CorrectionTaken{from.epoch(), from.generation(), std::move(*grid)};
}

Result<JournalEntry> RelocaliseOf(const record::Relocalise& from) {
  if (!from.has_t_map_robot()) return RelocaliseTaken{};
  const Pose2 T_map_robot = ValueOf(from.t_map_robot());
  if (!ValidateStart(T_map_robot)) return Unreadable("a pose");
  return RelocaliseTaken{T_map_robot};
}

// Whether the tiles can be read, and lie where a robot can be localised, is looked at by the estimator.
Result<LocaliseTaken> LocaliseOf(const record::Localise& from) {
  LocaliseTaken taken{from.maps_again(), {}, from.resolution_m(), from.epoch()};
  for (const record::Localise::Tile& tile : from.tiles()) {
    if (tile.encoding() > static_cast<std::uint32_t>(TileEncoding::kPng)) return Unreadable("a tile");
    auto added = std::make_shared<Tile>();
    added->key = {0, tile.x(), tile.y()};
    added->encoding = static_cast<TileEncoding>(tile.encoding());
    added->bytes.assign(tile.cells().begin(), tile.cells().end());
    taken.tiles.push_back(std::move(added));
  }
  return taken;
}

Result<JournalEntry> SuggestedOf(const record::PlaceSuggested& from) {
  auto map = LocaliseOf(from.map());
  if (!map) return tl::unexpected(map.error());
  const Pose2 T_map_robot = ValueOf(from.t_map_robot());
  if (!ValidateStart(T_map_robot)) return Unreadable("a pose");
  return PlaceSuggested{from.seen(), T_map_robot, *std::move(map)};
}

Result<JournalEntry> EntryOf(const record::Entry& from) {
  switch (from.content_case()) {
    case record::Entry::kScan:
      return ScanOf(from.scan());
    case record::Entry::kRefused:
      if (from.refused().reason() >= static_cast<std::uint32_t>(kDropReasonCount)) return Unreadable("a refused scan");
      return ScanRefused{ValueOf(from.refused().stream()), from.refused().sequence(),
                         static_cast<DropReason>(from.refused().reason())};
    case record::Entry::kOdometry:
      return OdometryOf(from.odometry());
    case record::Entry::kOwner:
      return OwnerChanged{from.owner().client(),
                          from.owner().session(),
                          {from.owner().sensors().begin(), from.owner().sensors().end()}};
    case record::Entry::kCorrection:
      return CorrectionOf(from.correction());
    case record::Entry::kEpoch:
      return EpochChanged{from.epoch().epoch()};
    case record::Entry::kRelocalise:
      return RelocaliseOf(from.relocalise());
    case record::Entry::kLocalise:
      return LocaliseOf(from.localise()).map([](LocaliseTaken&& taken) { return JournalEntry(std::move(taken)); });
    case record::Entry::kPlaceSuggested:
      return SuggestedOf(from.place_suggested());
    case record::Entry::kStartRefusal:
      return StartRefusal{from.start_refusal().why()};
    case record::Entry::kFinish:
      return SessionFinished{from.finish().final(), ValueOf(from.finish().status())};
    case record::Entry::CONTENT_NOT_SET:
      break;
  }
  return Unreadable("a journal entry");
}

}  // namespace

std::string BytesOf(std::uint64_t first, const std::vector<JournalEntry>& entries) {
  record::Batch batch;
  batch.set_first(first);
  for (const JournalEntry& entry : entries) {
    std::visit([&added = *batch.add_entries()](const auto& content) { FillEntry(added, content); }, entry);
  }
  return batch.SerializeAsString();
}

Result<StoredBatch> BatchOf(std::string_view bytes) {
  record::Batch from;
  if (!from.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return Unreadable("a journal");
  StoredBatch batch{.first = from.first(), .entries = {}};
  for (const record::Entry& one : from.entries()) {
    auto entry = EntryOf(one);
    if (!entry) return tl::unexpected(entry.error());
    batch.entries.push_back(std::move(*entry));
  }
  return batch;
}

}  // namespace cairn::server
