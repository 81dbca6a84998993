// How the state of a session's estimator is saved, and restored from that and from the journal (session_estimator.h).
#include <utility>
#include <variant>

#include "common/file/number_bytes.h"
#include "server/maps/stored_grid.h"
#include "server/robots/session_estimator.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;

// The main part of a checkpoint: of the session, with the number of its pieces, and of the estimator.
struct CheckpointParts {
  std::string_view session;
  std::uint64_t session_pieces = 0;
  std::string_view estimator;
};

Result<CheckpointParts> PartsOf(std::string_view main) {
  const auto too_short = [] { return Fail(StatusCode::kDataLoss, "a checkpoint is too short"); };
  CheckpointParts parts;
  const auto size = TakeNumber<std::uint64_t>(main);
  if (!size || *size > main.size()) return too_short();
  parts.session = main.substr(0, *size);
  main.remove_prefix(parts.session.size());
  const auto pieces = TakeNumber<std::uint64_t>(main);
  if (!pieces) return too_short();
  parts.session_pieces = *pieces;
  parts.estimator = main;
  return parts;
}

}  // namespace

void SessionEstimator::Replay(JournalEntry&& entry, const Switched& switched) {
  replaying_ = true;
  if (auto* const scan = std::get_if<ScanTaken>(&entry)) {
    if (record_.ScanReceived(scan->stream, scan->scan->sequence, SessionRecord::From::kJournal) ==
        SessionRecord::Arrival::kNew)
      On(ScanArrival{scan->stream, std::move(scan->scan), std::nullopt, Clock::now()});
  } else if (const auto* const refused = std::get_if<ScanRefused>(&entry)) {
    if (record_.ScanReceived(refused->stream, refused->sequence, SessionRecord::From::kJournal) ==
        SessionRecord::Arrival::kNew)
      record_.ScanDropped(refused->stream, refused->sequence, refused->reason);
  } else if (const auto* const odometry = std::get_if<OdometryTaken>(&entry)) {
    ReplayOdometry(*odometry);
  } else if (const auto* const owner = std::get_if<OwnerChanged>(&entry)) {
    static_cast<void>(record_.AddSensors(owner->sensors));
    static_cast<void>(record_.Resume(owner->client, owner->session));
  } else if (const auto* const correction = std::get_if<CorrectionTaken>(&entry)) {
    DrawToTheEnd();
    // A switch that was not completed before the server ended has no effect.
    if (switched(correction->epoch, correction->generation))
      static_cast<void>(AdoptGrid(correction->epoch, FromStored(correction->grid)));
    while (pipeline_.mapper().DrawLate()) {  // Nobody waits.
    }
  } else if (const auto* const epoch = std::get_if<EpochChanged>(&entry)) {
    SetEpoch(epoch->epoch);
  } else if (const auto* const relocalise = std::get_if<RelocaliseTaken>(&entry)) {
    On(RelocaliseWanted{relocalise->T_map_robot});
  } else if (auto* const localise = std::get_if<LocaliseTaken>(&entry)) {
    static_cast<void>(Localise(std::move(*localise)));
  } else if (const auto* const suggested = std::get_if<PlaceSuggested>(&entry)) {
    ReplaySuggestion(*suggested);
  } else if (auto* const refusal = std::get_if<StartRefusal>(&entry)) {
    On(StartRefused{std::move(refusal->why)});
  } else if (const auto* const finished = std::get_if<SessionFinished>(&entry)) {
    Finish finish;
    finish.final = finished->final;
    On(std::move(finish));
    static_cast<void>(record_.SetPhase(SessionPhase::kEnded, finished->status));
  }
}

void SessionEstimator::ReplayOdometry(const OdometryTaken& odometry) {
  const std::uint64_t sequence = odometry.odometry.sequence;
  if (!record_.OdometryReceived(odometry.stream.session, sequence, SessionRecord::From::kJournal)) return;
  if (odometry.use == OdometryUse::kTaken) return On(OdometryArrival{odometry.stream, odometry.odometry, false});
  record_.OdometryDropped(odometry.stream.session, sequence,
                          odometry.use == OdometryUse::kMerged ? DropReason::kQueueFull : DropReason::kBadGeometry);
}

Journal::Content SessionEstimator::Save() const {
  auto writer = std::make_shared<slam::StateWriter>();
  if (switch_completed_ && !*switch_completed_) return nullptr;
  // The server that loads it would draw all of them at once, or, after the end, none.
  if (pipeline_.mapper().draws_late() || FinishesMap()) return nullptr;
  // An older server of the same format would not read it, and the next scan ends this.
  if (pipeline_.odometry_has_just_begun()) return nullptr;
  // The scans themselves are saved by the pipeline, in the same order.
  std::vector<NameId> waiting;
  pipeline_.ForEachWaiting([&](const Scan& scan) { waiting.push_back(waiting_.at(&scan).stream.sensor_id); });
  (*writer)(epoch_, session_, fragment_, driven_m_, start_refused_, first_sequence_, first_stamp_, waiting);
  if (!record_.Save(*writer, WaitingBySensor())) return nullptr;
  return [writer, pipeline = std::make_shared<const slam::Checkpoint>(pipeline_.Save())] {
    const std::string own = writer->Main();
    CheckpointContent content{BytesOfNumber(std::uint64_t{own.size()}) + own +
                              BytesOfNumber(std::uint64_t{writer->pieces().size()}) + pipeline->Main()};
    for (const auto* const pieces : {&writer->pieces(), &pipeline->pieces()})
      for (const slam::StatePiece& piece : *pieces)
        content.pieces.push_back({piece.value, [piece] { return piece.Bytes(); }});
    return content;
  };
}

void SessionEstimator::BeginStoring(std::uint64_t position) {
  record_.BeginStoring(position, WaitingBySensor());
}

Result<SessionEstimator::PieceValues> SessionEstimator::Load(std::string_view main,
                                                             std::span<const std::string_view> pieces) {
  const auto parts = PartsOf(main);
  if (!parts) return tl::unexpected(parts.error());
  if (parts->session_pieces > pieces.size()) return Fail(StatusCode::kDataLoss, "a checkpoint is too short");
  // The estimator is loaded first: if that fails, nothing has changed.
  const auto loaded = pipeline_.LoadPieces(parts->estimator, pieces.subspan(parts->session_pieces));
  if (!loaded) return tl::unexpected(loaded.error());
  const auto opened = slam::OpenCheckpoint(parts->estimator, options_);  // Both parts have one format.
  if (!opened) return tl::unexpected(opened.error());
  slam::StateReader reader(parts->session, pieces.first(parts->session_pieces), opened->format);
  std::vector<NameId> waiting;
  reader(epoch_, session_, fragment_, driven_m_, start_refused_);
  if (reader.format() >= 9) reader(first_sequence_, first_stamp_);
  reader(waiting);
  T_map_keyframe_.reset();
  waiting_.clear();
  std::size_t next = 0;
  pipeline_.ForEachWaiting([&](const Scan& scan) {
    if (reader.Require(next < waiting.size(), "number of waiting scans"))
      waiting_.emplace(
          &scan, Waiting{{identity_.status.session.robot_id, waiting[next++], session_}, scan.sequence, Clock::now()});
  });
  reader.Require(next == waiting.size(), "number of waiting scans");
  if (auto record = record_.Load(reader, WaitingBySensor()); !record) return tl::unexpected(record.error());
  if (const auto map = pipeline_.mapper().known_map(); map != nullptr && known_grids_ != nullptr)
    pipeline_.mapper().ShareKnownMap(known_grids_->SameAs(map));
  record_.SetLearned(pipeline_.mapper().learned());
  ended_ = record_.phase() == SessionPhase::kEnded;
  record_.SetLocalises(pipeline_.mapper().localises());
  path_changed_at_ = pipeline_.mapper().path_changed_at();
  TellJoining();
  PieceValues values = reader.values();
  values.insert(values.end(), loaded->begin(), loaded->end());
  return values;
}

Result<slam::MapperOptions> SessionEstimator::OptionsOf(std::string_view main, const slam::MapperOptions& here) {
  const auto parts = PartsOf(main);
  if (!parts) return tl::unexpected(parts.error());
  return slam::OptionsOf(parts->estimator, here);
}

SessionRecord::WaitingScans SessionEstimator::WaitingBySensor() const {
  SessionRecord::WaitingScans waiting;
  for (const auto& [scan, one] : waiting_) waiting[one.stream.sensor_id].insert(one.sequence);
  return waiting;
}

void SessionEstimator::Replayed() {
  replaying_ = false;
  DrawToTheEnd();
  static_cast<void>(TakeGridChange());  // The whole grid is reported instead.
  GridChange whole{.session = identity_.id, .chunks = {}, .drawn = Drawn()};
  for (const auto& [key, chunk] : pipeline_.mapper().ShareGrid()) whole.chunks.emplace_back(key, chunk);
  if (!whole.chunks.empty()) outputs_.grid_changed(std::move(whole));
  RefreshLandmarks(true);
}

}  // namespace cairn::server
