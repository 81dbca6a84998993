#include "server/slam/landmarks/association.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

constexpr double kSquareM = 2.0;           // Width of a square.
constexpr double kMostM = 1e6;             // No robot gets there.
constexpr std::size_t kMostSquares = 256;  // A box that touches more is compared with every sighting.

}  // namespace

void LandmarkIndex::Name(std::size_t slot, const LandmarkSignature& signature) {
  if (slot >= places_.size()) places_.resize(slot + 1);
  if (places_[slot].box.isEmpty()) places_[slot].signature = signature;
}

void LandmarkIndex::Forget(const std::vector<bool>& used) {
  for (std::size_t slot = 0; slot < places_.size(); ++slot)
    if (!used[slot]) places_[slot].box.setEmpty();
  EnterAll();
}

// In the order of the slots.
std::vector<std::size_t> LandmarkIndex::Near(const LandmarkSignature& signature, const Eigen::AlignedBox2d& box,
                                             const LandmarkOptions& options) const {
  std::vector<std::size_t> near;
  const auto look = [&](std::size_t slot) {
    if (places_[slot].box.intersects(box) && Alike(places_[slot].signature, signature, options)) near.push_back(slot);
  };
  const std::optional<Squares> squares = SquaresOf(box);
  if (!squares) {
    for (std::size_t slot = 0; slot < places_.size(); ++slot) look(slot);
    return near;
  }
  for (int x = squares->first_x; x <= squares->last_x; ++x) {
    for (int y = squares->first_y; y <= squares->last_y; ++y) {
      const auto found = by_square_.find(KeyOf(x, y));
      if (found == by_square_.end()) continue;
      for (const std::uint32_t slot : found->second) look(slot);
    }
  }
  for (const std::uint32_t slot : large_) look(slot);
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  return near;
}

std::optional<LandmarkIndex::Squares> LandmarkIndex::SquaresOf(const Eigen::AlignedBox2d& box) {
  if (box.isEmpty() || !(box.min().cwiseAbs().maxCoeff() < kMostM && box.max().cwiseAbs().maxCoeff() < kMostM))
    return std::nullopt;
  const auto number = [](double along_m) { return static_cast<int>(std::floor(along_m / kSquareM)); };
  const Squares squares{number(box.min().x()), number(box.max().x()), number(box.min().y()), number(box.max().y())};
  return squares.count() <= kMostSquares ? std::optional(squares) : std::nullopt;
}

void LandmarkIndex::Enter(std::size_t slot, const Eigen::AlignedBox2d& before) {
  const auto number = static_cast<std::uint32_t>(slot);
  const std::optional<Squares> now = SquaresOf(places_[slot].box);
  const std::optional<Squares> had = SquaresOf(before);
  if (!now) {  // It stays in the squares that it had.
    if (had || before.isEmpty()) large_.push_back(number);
    return;
  }
  for (int x = now->first_x; x <= now->last_x; ++x) {
    for (int y = now->first_y; y <= now->last_y; ++y)
      if (!had || !had->Contains(x, y)) by_square_[KeyOf(x, y)].push_back(number);
  }
}

void LandmarkIndex::EnterAll() {
  by_square_.clear();
  large_.clear();
  for (std::size_t slot = 0; slot < places_.size(); ++slot)
    if (!places_[slot].box.isEmpty()) Enter(slot, Eigen::AlignedBox2d());
}

}  // namespace cairn::slam
