#include "server/slam/drawing/map_drawing.h"

#include <algorithm>
#include <utility>

namespace cairn::slam {
namespace {

// Keyframes drawn again with every scan, which takes a few milliseconds.
constexpr std::size_t kRedrawnPerScan = 20;

void DrawOnto(OccupancyGrid& grid, const Keyframe& keyframe, const Pose2& T_map_robot,
              OccupancyGrid::Looks* looks = nullptr) {
  if (keyframe.localized) grid.Draw(*keyframe.scan, T_map_robot, {}, looks);
}

}  // namespace

void MapDrawing::Add(const Keyframe& keyframe, const Pose2& T_map_robot) {
  path_.push_back(T_map_robot);
  if (late_ > 0) {
    ++late_;  // What is seen later must be drawn later, because it wins.
  } else {
    DrawOnto(grid_, keyframe, T_map_robot, &looks_);
  }
}

void MapDrawing::StartAgain(std::uint64_t made) {
  changed_at_ = made;
  redraw_ = Redraw{OccupancyGrid(grid_.options()), 0};
}

void MapDrawing::Begin(std::span<const Keyframe> keyframes, const PosePath& path) {
  StartAgain(keyframes.size());
  path_ = path.values();
  late_ = 0;
  frozen_path_.Forget();
  DrawOnto(grid_, keyframes.back(), path_.back());
}

void MapDrawing::Continue(std::span<const Keyframe> keyframes, const PosePath& path) {
  DrawLate(keyframes);
  if (!redraw_) return;
  const std::size_t end = std::min(keyframes.size(), redraw_->drawn + kRedrawnPerScan);
  for (std::size_t& k = redraw_->drawn; k < end; ++k) DrawOnto(redraw_->grid, keyframes[k], path[k]);
  if (redraw_->drawn < keyframes.size()) return;
  grid_.ReplaceBy(std::move(redraw_->grid));
  looks_.clear();
  redraw_.reset();
  late_ = 0;
  path_ = path.values();
  frozen_path_.Forget();
}

void MapDrawing::DrawLate(std::span<const Keyframe> keyframes) {
  const std::size_t begin = drawn(), end = begin + std::min(late_, kRedrawnPerScan);
  for (std::size_t k = begin; k < end; ++k) DrawOnto(grid_, keyframes[k], path_[k]);
  late_ -= end - begin;
}

void MapDrawing::DrawAllLate(std::span<const Keyframe> keyframes) {
  while (late()) DrawLate(keyframes);
}

void MapDrawing::Retire(const Retirement& retirement) {
  KeepOnly(path_, retirement);
  frozen_path_.Forget();
}

void MapDrawing::Finish(std::span<const Keyframe> keyframes, const PosePath& path) {
  DrawAllLate(keyframes);
  while (redraw_) Continue(keyframes, path);
}

void MapDrawing::Adopt(OccupancyGrid grid, std::uint64_t made, std::size_t drawn, std::span<const Keyframe> keyframes,
                       const PosePath& path, bool along_path, std::span<const Pose2> in_grid) {
  const bool outdated = made < changed_at_ || (redraw_ && !along_path);
  redraw_.reset();
  grid_.ReplaceBy(std::move(grid));
  looks_.clear();
  const bool placed = path_.size() == keyframes.size();
  const bool few = !placed || keyframes.size() - drawn <= kRedrawnPerScan;
  for (std::size_t k = drawn; few && k < keyframes.size(); ++k) DrawOnto(grid_, keyframes[k], path[k]);
  if (along_path) path_ = path.values();
  if (placed && in_grid.size() == drawn) std::ranges::copy(in_grid, path_.begin());
  for (std::size_t k = drawn; placed && k < keyframes.size(); ++k) path_[k] = path[k];
  frozen_path_.Forget();
  late_ = few ? 0 : keyframes.size() - drawn;
  if (outdated) redraw_ = Redraw{OccupancyGrid(grid_.options()), 0};
}

}  // namespace cairn::slam
