#include "tests/studies/sensitivity/constants.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::studies {
namespace {

using Options = slam::MapperOptions;

double Change(double& value, int direction) {
  return value = std::ldexp(value, direction);
}

double Change(std::int64_t& value, int direction) {
  value = std::max<std::int64_t>(1, std::llround(std::ldexp(static_cast<double>(value), direction)));
  return static_cast<double>(value);
}

template <typename Field>
Constant Of(std::string name, Runs runs, Field field) {
  return {std::move(name), runs,
          [field](Options& options, int direction) { return Change(field(options), direction); }};
}

template <typename Field>
Constant Share(std::string name, Runs runs, Field field) {
  return {std::move(name), runs, [field](Options& options, int direction) {
            double& share = field(options);
            share = direction > 0 ? std::min(2.0 * share, 1.0 - 0.5 * (1.0 - share)) : std::ldexp(share, direction);
            return share;
          }};
}

#define CAIRN_FIELD(path)    \
  [](Options & o) -> auto& { \
    return o.path;           \
  }

void AddTracking(std::vector<Constant>& all) {
  const Runs runs = Runs::kUsual;
  all.push_back(Share("tracking: retry_below", runs, CAIRN_FIELD(front_end.retry_below)));
  all.push_back(Of("tracking: retry.turn_step_rad", runs, CAIRN_FIELD(front_end.retry.turn_step_rad)));
  all.push_back(Of("tracking: retry.sigma_m", runs, CAIRN_FIELD(front_end.retry.sigma_m)));
  all.push_back(Of("tracking: retry.sigma_rad", runs, CAIRN_FIELD(front_end.retry.sigma_rad)));
  all.push_back(Of("tracking: reference_keyframes", runs, CAIRN_FIELD(front_end.reference_keyframes)));
  all.push_back(Of("tracking: odometry.trans_base_m", runs, CAIRN_FIELD(front_end.odometry.trans_base_m)));
  all.push_back(Of("tracking: odometry.trans_per_m", runs, CAIRN_FIELD(front_end.odometry.trans_per_m)));
  all.push_back(Of("tracking: odometry.rot_base_rad", runs, CAIRN_FIELD(front_end.odometry.rot_base_rad)));
  all.push_back(Of("tracking: odometry.rot_per_m", runs, CAIRN_FIELD(front_end.odometry.rot_per_m)));
  all.push_back(Of("tracking: odometry.rot_per_rad", runs, CAIRN_FIELD(front_end.odometry.rot_per_rad)));
}

void AddRefinement(std::vector<Constant>& all) {
  const Runs runs = Runs::kUsual;
  all.push_back(Share("refine: rough_trust", runs, CAIRN_FIELD(front_end.refine.rough_trust)));
  all.push_back(Share("refine: same_side", runs, CAIRN_FIELD(front_end.refine.same_side)));
  all.push_back(Of("refine: cauchy_share", runs, CAIRN_FIELD(front_end.refine.cauchy_share)));
  all.push_back(Of("refine: shrink_iterations", runs, CAIRN_FIELD(front_end.refine.shrink_iterations)));
  all.push_back(Of("refine: first_pair_distance_m", runs, CAIRN_FIELD(front_end.refine.first_pair_distance_m)));
  all.push_back(Of("refine: last_pair_distance_m", runs, CAIRN_FIELD(front_end.refine.last_pair_distance_m)));
  all.push_back(Of("refine: residual_sigma_m", runs, CAIRN_FIELD(front_end.refine.residual_sigma_m)));
  all.push_back(Of("refine: inlier_distance_m", runs, CAIRN_FIELD(front_end.refine.inlier_distance_m)));
  all.push_back(Share("refine: min_score", runs, CAIRN_FIELD(front_end.refine.min_score)));
  all.push_back(Of("refine: max_iterations", runs, CAIRN_FIELD(front_end.refine.max_iterations)));
  all.push_back(Of("refine: stop_step_m", runs, CAIRN_FIELD(front_end.refine.stop_step_m)));
}

void AddSurface(std::vector<Constant>& all) {
  const Runs runs = Runs::kUsual;
  all.push_back(Of("surface: max_range_m", runs, CAIRN_FIELD(front_end.surface.max_range_m)));
  all.push_back(Of("surface: min_spacing_m", runs, CAIRN_FIELD(front_end.surface.min_spacing_m)));
  all.push_back(Of("surface: neighbour_span_m", runs, CAIRN_FIELD(front_end.surface.neighbour_span_m)));
  all.push_back(Share("surface: max_flatness", runs, CAIRN_FIELD(front_end.surface.max_flatness)));
  all.push_back(Of("surface: span_steps", runs, CAIRN_FIELD(front_end.surface.span_steps)));
  all.push_back(Of("surface: skipped_beams", runs, CAIRN_FIELD(front_end.surface.skipped_beams)));
  all.push_back(Of("surface: grazing_gap_m", runs, CAIRN_FIELD(front_end.surface.grazing_gap_m)));
  all.push_back(Of("surface: grazing_flat_m", runs, CAIRN_FIELD(front_end.surface.grazing_flat_m)));
  all.push_back(Of("surface: grazing_beams", runs, CAIRN_FIELD(front_end.surface.grazing_beams)));
}

void AddFeatures(std::vector<Constant>& all) {
  const Runs runs = Runs::kUsual;
  all.push_back(Of("features: lines.jump_m", runs, CAIRN_FIELD(front_end.features.lines.jump_m)));
  all.push_back(Of("features: lines.split_m", runs, CAIRN_FIELD(front_end.features.lines.split_m)));
  all.push_back(Of("features: lines.split_per_m", runs, CAIRN_FIELD(front_end.features.lines.split_per_m)));
  all.push_back(Of("features: lines.min_length_m", runs, CAIRN_FIELD(front_end.features.lines.min_length_m)));
  all.push_back(Of("features: lines.max_deviation_m", runs, CAIRN_FIELD(front_end.features.lines.max_deviation_m)));
  all.push_back(Of("features: lines.end_gap_m", runs, CAIRN_FIELD(front_end.features.lines.end_gap_m)));
  all.push_back(Of("features: lines.end_uncertainty_m", runs, CAIRN_FIELD(front_end.features.lines.end_uncertainty_m)));
  all.push_back(Of("features: corners.real_gap_m", runs, CAIRN_FIELD(front_end.features.corners.real_gap_m)));
  all.push_back(
      Of("voting: candidates.max_translation_m", runs, CAIRN_FIELD(matching.voting.candidates.max_translation_m)));
  all.push_back(Of("voting: selection.min_votes", runs, CAIRN_FIELD(matching.voting.selection.min_votes)));
  all.push_back(Of("voting: fault.max_translation_m", runs, CAIRN_FIELD(matching.voting.fault.max_translation_m)));
}

void AddFilter(std::vector<Constant>& all) {
  const Runs runs = Runs::kUsual;
  all.push_back(Of("filter: particles", runs, CAIRN_FIELD(filter.particles)));
  all.push_back(Of("filter: drift.trans_base_m", runs, CAIRN_FIELD(filter.back_end.drift.trans_base_m)));
  all.push_back(Of("filter: drift.trans_per_m", runs, CAIRN_FIELD(filter.back_end.drift.trans_per_m)));
  all.push_back(Of("filter: drift.trans_per_rad", runs, CAIRN_FIELD(filter.back_end.drift.trans_per_rad)));
  all.push_back(Of("filter: drift.rot_base_rad", runs, CAIRN_FIELD(filter.back_end.drift.rot_base_rad)));
  all.push_back(Of("filter: drift.rot_per_m", runs, CAIRN_FIELD(filter.back_end.drift.rot_per_m)));
  all.push_back(Of("filter: drift.rot_per_rad", runs, CAIRN_FIELD(filter.back_end.drift.rot_per_rad)));
  all.push_back(Of("filter: sample_distance_m", runs, CAIRN_FIELD(filter.fastslam.sample_distance_m)));
  all.push_back(Share("filter: drawn_share", runs, CAIRN_FIELD(filter.fastslam.drawn_share)));
  all.push_back(Share("filter: resample_below", runs, CAIRN_FIELD(filter.fastslam.resample_below)));
  all.push_back(Of("filter: gate.distance_m", runs, CAIRN_FIELD(gate.distance_m)));
  all.push_back(Of("filter: gate.turn_rad", runs, CAIRN_FIELD(gate.turn_rad)));
  all.push_back(Of("filter: blind.trans_per_m", runs, CAIRN_FIELD(blind.trans_per_m)));
  all.push_back(Of("filter: odometry_walk.trans_m_per_sqrt_m", runs, CAIRN_FIELD(odometry_walk.trans_m_per_sqrt_m)));
}

void AddLandmarks(std::vector<Constant>& all) {
  const Runs runs = Runs::kUsual;
  all.push_back(Of("landmarks: range_m", runs, CAIRN_FIELD(filter.back_end.landmarks.noise.range_m)));
  all.push_back(Of("landmarks: bearing_rad", runs, CAIRN_FIELD(filter.back_end.landmarks.noise.bearing_rad)));
  all.push_back(Of("landmarks: slope_rad", runs, CAIRN_FIELD(filter.back_end.landmarks.noise.slope_rad)));
  all.push_back(Of("landmarks: min_sightings", runs, CAIRN_FIELD(filter.back_end.landmarks.min_sightings)));
  all.push_back(Of("landmarks: same_distance_m", runs, CAIRN_FIELD(filter.back_end.landmarks.same_distance_m)));
  all.push_back(Of("landmarks: same_angle_rad", runs, CAIRN_FIELD(filter.back_end.landmarks.same_angle_rad)));
  all.push_back(Of("landmarks: same_length_m", runs, CAIRN_FIELD(filter.back_end.landmarks.same_length_m)));
  all.push_back(Of("landmarks: crowded_m", runs, CAIRN_FIELD(filter.back_end.landmarks.crowded_m)));
  all.push_back(Of("landmarks: forget_m", runs, CAIRN_FIELD(filter.back_end.landmarks.forget_m)));
  all.push_back(Of("landmarks: match_slope_rad", runs, CAIRN_FIELD(filter.back_end.landmarks.match_slope_rad)));
  all.push_back(Of("landmarks: min_travel_m", runs, CAIRN_FIELD(filter.back_end.landmarks.min_travel_m)));
}

void AddRevisits(std::vector<Constant>& all) {
  const Runs runs = Runs::kUsual;
  all.push_back(Of("revisit: max_distance_m", runs, CAIRN_FIELD(revisit.max_distance_m)));
  all.push_back(Of("revisit: max_turn_rad", runs, CAIRN_FIELD(revisit.max_turn_rad)));
  all.push_back(Of("revisit: neighbours", runs, CAIRN_FIELD(revisit.neighbours)));
  all.push_back(Of("revisit: sigma_m", runs, CAIRN_FIELD(revisit.sigma_m)));
}

void AddLoops(std::vector<Constant>& all) {
  const Runs runs = Runs::kLoops;
  all.push_back(Of("loop: every_m", runs, CAIRN_FIELD(loop.every_m)));
  all.push_back(Of("loop: doubt_per_m", runs, CAIRN_FIELD(loop.doubt_per_m)));
  all.push_back(Of("loop: doubt_rad_per_m", runs, CAIRN_FIELD(loop.doubt_rad_per_m)));
  all.push_back(Of("loop: max_doubt_m", runs, CAIRN_FIELD(loop.max_doubt_m)));
  all.push_back(Share("loop: max_rival", runs, CAIRN_FIELD(loop.max_rival)));
  all.push_back(Share("loop: max_conflict", runs, CAIRN_FIELD(loop.max_conflict)));
  all.push_back(Of("loop: confirm_after_m", runs, CAIRN_FIELD(loop.confirm_after_m)));
  all.push_back(Of("loop: sigma_m", runs, CAIRN_FIELD(loop.sigma_m)));
  all.push_back(Of("loop: free_cell_m", runs, CAIRN_FIELD(loop.free_cell_m)));
  all.push_back(Of("pose_graph: tolerance", runs, CAIRN_FIELD(pose_graph.tolerance)));
  all.push_back(Of("pose_graph: max_iterations", runs, CAIRN_FIELD(pose_graph.max_iterations)));
}

void AddSelfCheck(std::vector<Constant>& all) {
  const Runs runs = Runs::kSelfCheck;
  all.push_back(Of("self_check: min_travel_m", runs, CAIRN_FIELD(self_check.min_travel_m)));
  all.push_back(Of("self_check: near_m", runs, CAIRN_FIELD(self_check.near_m)));
  all.push_back(Share("self_check: max_conflict", runs, CAIRN_FIELD(self_check.max_conflict)));
}

void AddRolling(std::vector<Constant>& all) {
  const Runs runs = Runs::kRolling;
  all.push_back(Of("rolling: surface_gap_m", runs, CAIRN_FIELD(pairing.rolling.deskew.surface_gap_m)));
  all.push_back(Of("rolling: surface_steps", runs, CAIRN_FIELD(pairing.rolling.deskew.surface_steps)));
  all.push_back(Of("rolling: longest_s", runs, CAIRN_FIELD(pairing.rolling.longest_s)));
  all.push_back(Of("rolling: worthwhile_m", runs, CAIRN_FIELD(pairing.rolling.worthwhile_m)));
  all.push_back(Of("rolling: worthwhile_rad", runs, CAIRN_FIELD(pairing.rolling.worthwhile_rad)));
  all.push_back(Of("rolling: most_looks", runs, CAIRN_FIELD(pairing.rolling.most_looks)));
}

void AddPairing(std::vector<Constant>& all) {
  const Runs runs = Runs::kMoved;
  all.push_back(Of("pairing: max_pause_s", runs, CAIRN_FIELD(pairing.max_pause_s)));
  all.push_back(Of("pairing: max_speed_m_s", runs, CAIRN_FIELD(pairing.max_speed_m_s)));
  all.push_back(Of("pairing: same_place_m", runs, CAIRN_FIELD(pairing.same_place_m)));
  all.push_back(Of("pairing: same_heading_rad", runs, CAIRN_FIELD(pairing.same_heading_rad)));
}

void AddRecovery(std::vector<Constant>& all) {
  const Runs runs = Runs::kMoved;
  all.push_back(Of("recovery: place.cell_scale", runs, CAIRN_FIELD(recovery.place.cell_scale)));
  all.push_back(Of("recovery: place.map_reach_m", runs, CAIRN_FIELD(recovery.place.map_reach_m)));
  all.push_back(Share("recovery: place.min_explained", runs, CAIRN_FIELD(recovery.place.min_explained)));
  all.push_back(Of("recovery: place.min_compared", runs, CAIRN_FIELD(recovery.place.min_compared)));
  all.push_back(Of("recovery: place.near_keyframes", runs, CAIRN_FIELD(recovery.place.near_keyframes)));
  all.push_back(Of("recovery: place.apart_m", runs, CAIRN_FIELD(recovery.place.apart_m)));
  all.push_back(Share("recovery: place.max_conflict", runs, CAIRN_FIELD(recovery.place.max_conflict)));
  all.push_back(Of("recovery: on_path_m", runs, CAIRN_FIELD(recovery.on_path_m)));
  all.push_back(Of("recovery: on_path_rad", runs, CAIRN_FIELD(recovery.on_path_rad)));
  all.push_back(Of("recovery: still_m", runs, CAIRN_FIELD(recovery.still_m)));
  all.push_back(Of("recovery: still_rad", runs, CAIRN_FIELD(recovery.still_rad)));
  all.push_back(Of("recovery: same_range_m", runs, CAIRN_FIELD(recovery.same_range_m)));
  all.push_back(Of("recovery: same_range_per_m", runs, CAIRN_FIELD(recovery.same_range_per_m)));
  all.push_back(Share("recovery: unchanged", runs, CAIRN_FIELD(recovery.unchanged)));
  all.push_back(Share("recovery: unchanged_along_corridor", runs, CAIRN_FIELD(recovery.unchanged_along_corridor)));
  all.push_back(Of("recovery: short_pause_s", runs, CAIRN_FIELD(recovery.short_pause_s)));
  all.push_back(Of("recovery: as_odometry_m", runs, CAIRN_FIELD(recovery.as_odometry_m)));
  all.push_back(Of("recovery: as_odometry_per_m", runs, CAIRN_FIELD(recovery.as_odometry_per_m)));
  all.push_back(Of("recovery: as_odometry_rad", runs, CAIRN_FIELD(recovery.as_odometry_rad)));
}

void AddTheses(std::vector<Constant>& all) {
  all.push_back(Of("dpslam: low.unseen_per_m", Runs::kDpSlam, CAIRN_FIELD(filter.dpslam.low.unseen_per_m)));
  all.push_back(Of("dpslam: high.unseen_per_m", Runs::kDpSlam, CAIRN_FIELD(filter.dpslam.high.unseen_per_m)));
}

#undef CAIRN_FIELD

}  // namespace

std::vector<Constant> AllConstants() {
  std::vector<Constant> all;
  AddTracking(all);
  AddRefinement(all);
  AddSurface(all);
  AddFeatures(all);
  AddFilter(all);
  AddLandmarks(all);
  AddRevisits(all);
  AddLoops(all);
  AddSelfCheck(all);
  AddRolling(all);
  AddTheses(all);
  return all;
}

std::vector<Constant> RecoveryConstants() {
  std::vector<Constant> all;
  AddPairing(all);
  AddRecovery(all);
  return all;
}

}  // namespace cairn::studies
