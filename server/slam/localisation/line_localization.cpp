#include "server/slam/localisation/line_localization.h"

#include <algorithm>
#include <cmath>

#include "server/slam/localisation/place_hypotheses.h"

namespace cairn::slam {
namespace {

// Keyframes in a row that have to agree with the belief before a lost robot counts as found.
constexpr int kFoundAgain = 3;

// The poses that the gate accepts, except hypotheses whose own uncertainty is larger than that of a step or
// two.
LineMatchWindow WindowOf(const PoseBelief& belief) {
  constexpr double kSigmas = 5.0, kMarginM = 0.5, kMarginRad = Radians(10.0);
  return {belief.T_map_robot, kMarginM + kSigmas * std::sqrt(belief.covariance.topLeftCorner<2, 2>().trace()),
          kMarginRad + kSigmas * std::sqrt(belief.covariance(2, 2))};
}

}  // namespace

void Visit(OptionVisitor& visitor, LocalizationOptions& options) {
  visitor.Text(
      "map", options.file,
      ForOperators(
          "File with the lines of the known map, for the filter line_match. `cairn-offline --map-lines` writes one."));
  visitor.Flag(
      "start_known", options.start_known,
      ForOperators(
          "Whether the start pose that a robot names is about right. If not, line_match searches the whole map."));
  visitor.Real("start_sigma_m", options.start_sigma_m, "m", 0.001, 100.0,
               "Standard deviation of the start position, if start_known is true.");
  visitor.Real("start_sigma_rad", options.start_sigma_rad, "rad", 0.001, kPi,
               "Standard deviation of the start heading, if start_known is true.");
  visitor.Real("every_m", options.every_m, "m", 0.0, 100.0,
               "Way between two searches of the whole map while the place is not known.");
  visitor.Real(
      "max_reach_m", options.max_reach_m, "m", 1.0, 1000.0,
      "The lines of the map are searched around a known place as far as the laser sees, but not farther than this.");
  visitor.Real("lost_after_m", options.lost_after_m, "m", 0.1, 1000.0,
               "The robot counts as lost when nothing near the estimated pose has matched for this way.");
  visitor.Section("places", "Which of the places found in the whole map is accepted.",
                  [&] { Visit(visitor, options.places); });
  visitor.Section("search", "LineMatch, the search for poses.", [&] { Visit(visitor, options.search); });
}

LineLocalization::LineLocalization(const LocalizationOptions& options, const BackEndOptions& back_end,
                                   const Pose2& T_map_robot_start)
    : SinglePathFilter(back_end.drift, T_map_robot_start),
      options_(options),
      drift_(back_end.drift),
      places_(options.places),
      placed_(options.start_known),
      tracking_(options.start_known) {
  if (!options_.map) options_.map = std::make_shared<const std::vector<MapLine>>();
  if (!options_.start_known) return;
  path_.Correct(T_map_robot_start, PoseCovariance(options_.start_sigma_m, options_.start_sigma_rad));
}

void LineLocalization::Predict(const StepMotion& step) {
  path_.Advance(step.T_prev_curr, step.covariance_prev);
  places_.Predict(step.T_prev_curr, drift_.Covariance(step.T_prev_curr) + step.covariance_prev);
  nis_ = 0.0;
  nis_dimension_ = 0;
}

void LineLocalization::Observe(const KeyframeSight& sight, const ParallelFor& /*parallel_for*/) {
  Observe(sight.view.features.lines, sight.travelled_m);
}

void LineLocalization::Observe(std::span<const LineFeature> lines_robot, double travelled_m) {
  if (placed_) {
    found_in_a_row_ = Follow(lines_robot) ? found_in_a_row_ + 1 : 0;
    if (found_in_a_row_ > 0) found_at_m_ = travelled_m;
    tracking_ = tracking_ ? travelled_m - found_at_m_ < options_.lost_after_m : found_in_a_row_ >= kFoundAgain;
  }
  if (tracking_) {
    places_.Clear();
  } else if (travelled_m - searched_at_m_ >= options_.every_m) {
    SearchEverywhere(lines_robot, travelled_m);
  }
}

bool LineLocalization::Follow(std::span<const LineFeature> lines_robot) {
  const PoseBelief belief{path_.T_map_robot(), path_.covariance()};
  const LineMatchWindow window = WindowOf(belief);
  double seen_m = 0.0;
  for (const LineFeature& line : lines_robot) seen_m = std::max({seen_m, line.first.norm(), line.last.norm()});
  const double reach_m = std::min(options_.max_reach_m, seen_m + window.reach_m);
  const auto near = LinesNear(*options_.map, belief.T_map_robot.translation(), reach_m);
  const LineMatchAnswer answer = MatchLinesWithMap(near, lines_robot, options_.search, window);
  if (!answer.complete) return false;  // The nearest hypothesis may be missing.
  const auto nearest = Nearest(belief, answer.hypotheses);
  if (!nearest) return false;
  nis_ = DistanceOf(belief, answer.hypotheses[*nearest]);
  nis_dimension_ = 3;
  const PoseBelief fused = Fuse(belief, answer.hypotheses[*nearest]);
  path_.Correct(fused.T_map_robot, fused.covariance);
  return true;
}

void LineLocalization::SearchEverywhere(std::span<const LineFeature> lines_robot, double travelled_m) {
  searched_at_m_ = travelled_m;
  places_.Update(MatchLinesWithMap(*options_.map, lines_robot, options_.search));
  const auto place = places_.settled();
  if (!place) return;
  if (!placed_) path_.MoveTo(place->T_map_robot);
  path_.Correct(place->T_map_robot, place->covariance);
  placed_ = tracking_ = true;
  found_at_m_ = travelled_m;
}

FilterEstimate LineLocalization::estimate() const {
  return {path_.T_map_robot(), placed_ ? path_.covariance() : PoseBelief::Unknown().covariance};
}

}  // namespace cairn::slam
