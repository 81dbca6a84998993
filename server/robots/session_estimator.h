// The strand's side of a session: takes one event after the other and moves the estimator, the record and the map.
// An exception may leave Handle and then leaves the estimator in any state: from then on only Discard may be called.
// Not a queue and not an owner: it never asks who sent an event. After Finish it still answers snapshots and adopts
// corrections, so that a finished robot's part of the map can be smoothed.
// Thread rule: one thread at a time (the session's strand).
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "server/maps/shared_known_grids.h"
#include "server/outbound.h"
#include "server/robots/checkpoint_pace.h"
#include "server/robots/robot_event.h"
#include "server/robots/session_record.h"
#include "server/slam/scan_pipeline.h"
#include "server/store/journal.h"

namespace cairn::server {

// Where a session sends its results. None of the functions waits.
struct SessionOutputs {
  std::function<bool(OutboundValue)> send;
  std::function<void(GridChange&&)> grid_changed;
  // Writes an event that the session used into its journal. Returns whether it will be stored. Empty function: nothing
  // is stored.
  std::function<bool(JournalEntry)> store = {};
  // `position` returns the position of the last entry that `store` accepted, and `checkpoint` stores the state after
  // this entry (Journal::Checkpoint; not while `checkpointing`). Empty functions: no checkpoints.
  std::function<std::uint64_t()> position = {};
  std::function<bool()> checkpointing = {};
  std::function<bool(std::uint64_t position, Journal::Content content, Journal::Done done)> checkpoint = {};
  // Journal::Recover and Abandon, for a session that is no longer stored.
  std::function<std::uint64_t()> recover = {};
  std::function<void()> abandon = {};
  CheckpointPace::Limits checkpoint_limits = {};
  // Whether the site has a map by now. Asked before the first scan of the session was used. May be empty.
  std::function<bool()> map_begun = {};
  // What the session draws is not shown from now on, because it is not where it was said to start. May be empty.
  std::function<void()> hidden = {};
  // Called when the session ends. May be empty.
  std::function<void()> ended = {};
  // Called when the session has been destroyed, after all of its changes were reported. May be empty.
  std::function<void()> gone = {};
  // How long the session's work has waited for a thread, in each turn. Called on the strand; throws nothing. May be
  // empty.
  std::function<void(std::chrono::nanoseconds)> waited = {};
};

struct EstimatorSetup {
  slam::MapperOptions mapper;
  Pose2 T_map_robot_start;
  // Nobody has said where the robot starts in a map that others have begun. Its start is the origin of a frame of its
  // own, and it is not localized, until a map version joins it (maps/robot_grid.h).
  bool fragment = false;
  bool map_begun = false;  // Others had begun the map at the opening, so that it matters where the robot starts.
  // Maps that several robots are localised in; null: the session makes its own.
  std::shared_ptr<SharedKnownGrids> known_grids = {};
};

class SessionEstimator {
 public:
  SessionEstimator(const EstimatorSetup& setup, SessionRecord& record, SessionOutputs outputs);

  void Handle(RobotEvent&& event);
  // Settles an event without the estimator, also the one that failed: scans and odometry are counted as dropped,
  // whoever waits for an answer gets an empty one, and a correction is dropped.
  void Discard(RobotEvent&& event);
  // Draws some of what a grid lacks that was taken over with a correction (slam::Mapper::DrawLate), and of the map of a
  // session that has ended, where it is drawn again; and reports it. Returns whether there is more: to be called again,
  // also where no event comes.
  bool DrawLate();
  // Drops the scans inside the estimator.
  void DropWaiting();

  // Repeats what an earlier server did with this entry. After all entries, in their order, the estimator and the record
  // are in the same state as then. Nothing is sent. `switched` tells whether a switch of the map was completed (epoch,
  // generation).
  using Switched = std::function<bool(std::uint32_t epoch, std::uint64_t generation)>;
  void Replay(JournalEntry&& entry, const Switched& switched);
  // Called after the last entry: gives the drawn grid to the map.
  void Replayed();
  [[nodiscard]] bool replaying() const { return replaying_; }
  // Saves the state after the entries so far. The result is a function that makes the content; it may take long and may
  // run on any thread. Empty if the moment does not allow a checkpoint (SessionRecord::Save), or while DrawLate has
  // something to do. Load restores this state; then the entries that follow are replayed.
  [[nodiscard]] Journal::Content Save() const;
  // Called after each Save of which a checkpoint is made, before the next event. A place that a job has found, and that
  // the next scans have to confirm, is not part of the checkpoint, because it comes with a map. It is looked at anew
  // from here on, and is in the journal again as the first entry after the checkpoint. One that has waited for long is
  // given up instead.
  void RepeatSuggestion();
  // The session is stored again from here on; the Save at `position` holds what came before
  // (SessionRecord::BeginStoring).
  void BeginStoring(std::uint64_t position);
  // Returns the values of the pieces, in their order.
  using PieceValues = std::vector<std::shared_ptr<const void>>;
  [[nodiscard]] Result<PieceValues> Load(std::string_view main, std::span<const std::string_view> pieces);
  // The options of the estimator whose state this is (slam/checkpoint.h).
  [[nodiscard]] static Result<slam::MapperOptions> OptionsOf(std::string_view main, const slam::MapperOptions& here);

 private:
  struct Waiting {
    StreamId stream;
    std::uint64_t sequence = 0;
    std::chrono::steady_clock::time_point received;
  };

  void On(ScanArrival&& arrival);
  void On(OdometryArrival&& arrival);
  void On(Correction&& correction);
  void On(EpochChange&& change);
  void On(SnapshotWanted&& wanted);
  void On(RelocaliseWanted&& wanted);
  void On(LocaliseWanted&& wanted);
  void On(PlaceFound&& found);
  // Whether the robot's next scans will confirm the place in this map, or not. Null: it has none that can be used.
  bool Suggest(PlaceSuggested place, std::shared_ptr<const slam::KnownGrid> map);
  void ReplaySuggestion(const PlaceSuggested& place);
  // False if it cannot map again, because its place is not known or it is not joined with the map.
  bool Localise(LocaliseTaken&& taken);
  void On(StartRefused&& refused);
  void On(Finish&& finish);
  void Used(const Scan& scan, const slam::ScanOutcome& outcome);
  void Dropped(const Scan& scan, DropReason reason);
  void DoubtLateStart(const Scan& scan);
  void DoubtStartInNewMap(const Scan& scan);
  [[nodiscard]] bool OthersHaveBegun() const;
  [[nodiscard]] bool IsLate(const Scan& scan) const;
  void RefuseLateStart(const Scan& scan);
  void ComesFrom(SessionToken session);
  GridChange TakeGridChange();
  [[nodiscard]] DrawnPath Drawn() const;
  slam::OccupancyGrid::Chunks PublishedChunks();
  void RefreshLandmarks(bool at_once);
  // `in_known_map`: the robot is only localised.
  void RefreshHypotheses(const PoseReport& report, bool in_known_map);
  void Store(JournalEntry entry);
  [[nodiscard]] SessionRecord::WaitingScans WaitingBySensor() const;
  void ReplayOdometry(const OdometryTaken& odometry);
  RobotGrid DisplacedGrid();
  // Returns false if the grid stays as it was, because the path cannot follow.
  bool AdoptGrid(std::uint32_t epoch, const RobotGrid& grid);
  void FollowPath(std::optional<bool> fragment);
  void FitPath();
  // The session has ended and its map is being drawn again, which no scan does any more.
  [[nodiscard]] bool FinishesMap() const { return ended_ && pipeline_.mapper().draws_again(); }
  void DrawToTheEnd();
  void SetEpoch(std::uint32_t epoch);
  void Drive(const Pose2& T_map_robot);
  void TellJoining();

  SessionRecord& record_;
  const SessionOutputs outputs_;
  const SessionSnapshot identity_;  // Names and id; its other parts are empty.
  std::uint32_t epoch_ = 0;
  const bool began_as_fragment_;
  bool fragment_ = false;
  const slam::MapperOptions options_;
  const std::shared_ptr<SharedKnownGrids> known_grids_;
  std::string start_refused_;  // Why, if it was. Also when a job has found its place since.
  const bool map_begun_;
  // Number and stamp of the first scan that arrived, until one is used.
  std::optional<std::uint64_t> first_sequence_;
  Stamp first_stamp_ = 0;
  double driven_m_ = 0.0;                                      // See SessionRecord::Joining. Along the keyframes.
  std::optional<Pose2> T_map_keyframe_;                        // The last one; empty after a correction.
  std::uint64_t path_changed_at_ = 0;                          // Mapper::path_changed_at when past poses followed it.
  std::shared_ptr<const std::atomic<bool>> switch_completed_;  // Belongs to the last correction.
  bool ended_ = false;
  bool replaying_ = false;
  SessionToken session_ = 0;                          // The session of the last sample.
  std::unordered_map<const Scan*, Waiting> waiting_;  // Scans inside the pipeline; its pairing bounds them.
  std::chrono::steady_clock::time_point landmarks_refreshed_{};
  Stamp hypotheses_refreshed_ = 0;
  bool hypotheses_localized_ = false;
  std::vector<PoseHypothesis> looked_for_;  // What a job has found; empty again once the robot is localized.
  // The newest place that scans had to confirm, for RepeatSuggestion. Whether they still have to, the mapper knows.
  struct Suggested {
    PlaceSuggested place;
    std::shared_ptr<const slam::KnownGrid> map;
  };
  std::optional<Suggested> suggested_;
  slam::ScanPipeline pipeline_;
};

}  // namespace cairn::server
