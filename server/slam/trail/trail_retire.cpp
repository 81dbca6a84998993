// How a trail gives up keyframes: the graph of its relations is contracted.
#include <algorithm>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "common/geometry/rotated_covariance.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {
namespace {

// How well the place of a retired keyframe relative to its representative is known.
constexpr double kPlaceSigmaM = 0.05;
constexpr double kPlaceSigmaRad = 0.01;
// A relation that is handed over is given up if both its keyframes have so many loops already. Otherwise relations
// would grow without end in number and, as they repeat each other, in weight.
constexpr std::size_t kEnoughLoops = 12;

// The connected components of a graph of keyframes (union-find).
class Components {
 public:
  explicit Components(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
  // True if the two were not connected before.
  bool Join(std::size_t a, std::size_t b) {
    a = RootOf(a);
    b = RootOf(b);
    parent_[a] = b;
    return a != b;
  }

 private:
  std::size_t RootOf(std::size_t node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }
  std::vector<std::size_t> parent_;
};

// The same relation between the representatives of its two keyframes.
PoseRelation HandedOver(const PoseRelation& relation, const Retirement& retirement) {
  const Pose2& T_representative_from = retirement.T_representative_keyframe[relation.from];
  const Pose2& T_representative_to = retirement.T_representative_keyframe[relation.to];
  PoseRelation result{retirement.representative[relation.from], retirement.representative[relation.to],
                      T_representative_from * relation.T_from_to * T_representative_to.Inverse(),
                      Rotated(relation.covariance, T_representative_from.theta), true};
  // A shape stays one; how well it is kept is no matter of what was measured.
  if (KeepsShape(relation)) {
    result.covariance = relation.covariance;
    return result;
  }
  for (const std::size_t keyframe : {relation.from, relation.to})
    if (!retirement.IsKept(keyframe)) result.covariance += PoseCovariance(kPlaceSigmaM, kPlaceSigmaRad);
  return result;
}

// The relations between the keyframes that stay, by their indices afterwards. Keyframes that were connected
// still are.
std::vector<PoseRelation> Contracted(const std::vector<PoseRelation>& relations, const Retirement& retirement) {
  std::vector<PoseRelation> result;
  Components components(retirement.kept.size());
  std::vector<std::size_t> loops(retirement.kept.size());
  std::set<std::pair<std::size_t, std::size_t>> related;
  const auto add = [&](PoseRelation relation) {
    relation.from = retirement.index_after[relation.from];
    relation.to = retirement.index_after[relation.to];
    related.insert(std::minmax(relation.from, relation.to));
    if (relation.loop) ++loops[relation.from], ++loops[relation.to];
    result.push_back(relation);
  };
  const auto stays = [&](const PoseRelation& one) { return retirement.IsKept(one.from) && retirement.IsKept(one.to); };
  for (const PoseRelation& relation : relations) {
    if (!stays(relation)) continue;
    components.Join(retirement.index_after[relation.from], retirement.index_after[relation.to]);
    add(relation);
  }
  for (const PoseRelation& relation : relations) {
    if (stays(relation)) continue;
    const std::size_t from = retirement.index_after[relation.from], to = retirement.index_after[relation.to];
    if (from == to || related.contains(std::minmax(from, to))) continue;
    const bool needed = components.Join(from, to);
    if (needed || std::min(loops[from], loops[to]) < kEnoughLoops) add(HandedOver(relation, retirement));
  }
  return result;
}

}  // namespace

void Trail::Retire(const Retirement& retirement) {
  relations_ = Contracted(relations_, retirement);
  for (MapperSnapshot::ScanPlace& scan : scans_) {
    if (!retirement.IsKept(scan.keyframe))
      scan.T_keyframe_robot = retirement.T_representative_keyframe[scan.keyframe] * scan.T_keyframe_robot;
    scan.keyframe = retirement.index_after[scan.keyframe];
  }
  DropOldScans();
  KeepOnly(keyframes_, retirement);
  KeepOnly(shapes_, retirement);
  frozen_keyframes_.Forget();
  frozen_shapes_.Forget();
  frozen_relations_.Forget();
  RestoreRest();
}

void Trail::DropOldScans() {
  frozen_scans_.Forget();
  if (scans_.size() <= kMostScans) return;
  const auto end = scans_.end() - static_cast<std::ptrdiff_t>(kMostScans);
  scans_.erase(
      std::remove_if(scans_.begin(), end, [](const auto& scan) { return !(scan.T_keyframe_robot == Pose2{}); }), end);
  scans_.shrink_to_fit();
}

}  // namespace cairn::slam
