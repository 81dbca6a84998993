#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "server/slam/landmarks/association.h"
#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

// A landmark index and, beside it, all boxes, which are compared one by one.
class Both {
 public:
  void Grow(std::size_t slot, const LandmarkSignature& signature, const Eigen::Vector2d& p) {
    index_.Name(slot, signature);
    if (slot >= boxes_.size()) {
      boxes_.resize(slot + 1);
      signatures_.resize(slot + 1);
    }
    if (boxes_[slot].isEmpty()) signatures_[slot] = signature;
    index_.Grow(slot, p);
    boxes_[slot].extend(p);
  }
  void ExpectSame(const LandmarkSignature& signature, const Eigen::AlignedBox2d& box) const {
    std::vector<std::size_t> near;
    for (std::size_t slot = 0; slot < boxes_.size(); ++slot)
      if (boxes_[slot].intersects(box) && Alike(signatures_[slot], signature, options_)) near.push_back(slot);
    EXPECT_EQ(index_.Near(signature, box, options_), near);
    found_ += near.size();
  }
  void ForgetEveryThird() {
    std::vector<bool> used(boxes_.size());
    for (std::size_t slot = 0; slot < used.size(); ++slot) {
      used[slot] = slot % 3 != 0;
      if (!used[slot]) boxes_[slot].setEmpty();
    }
    index_.Forget(used);
  }
  void SaveAndLoad() {
    StateWriter writer;
    writer(index_);
    const std::string bytes = writer.Bytes();
    StateReader reader(bytes);
    reader(index_);
    ASSERT_TRUE(reader.done());
  }
  [[nodiscard]] std::size_t found() const { return found_; }

 private:
  LandmarkIndex index_;
  LandmarkOptions options_;
  std::vector<Eigen::AlignedBox2d> boxes_;
  std::vector<LandmarkSignature> signatures_;
  mutable std::size_t found_ = 0;
};

TEST(LandmarkIndex, FindsThoseThatAComparisonWithAllFinds) {
  std::mt19937 random(1);
  const auto any = [&](double most) { return std::uniform_real_distribution<double>(-most, most)(random); };
  Both both;
  std::vector<Eigen::Vector2d> centres;
  for (int i = 0; i < 300; ++i) centres.emplace_back(any(60.0), any(60.0));
  for (int round = 0; round < 2000; ++round) {
    const std::size_t slot = 2 * (random() % centres.size());  // Every second slot stays without a landmark.
    const double spread = slot % 40 == 0 ? 30.0 : 0.3;         // Some boxes become very large.
    both.Grow(slot, {slot % 4 == 0, 1.0}, centres[slot / 2] + Eigen::Vector2d(any(spread), any(spread)));
    if (round % 500 == 499) both.SaveAndLoad();
    if (round % 700 == 699) both.ForgetEveryThird();
    const Eigen::Vector2d p(any(70.0), any(70.0)), reach(std::abs(any(3.0)), std::abs(any(3.0)));
    both.ExpectSame({round % 2 == 0, 1.0}, {p - reach, p + reach});
  }
  EXPECT_GT(both.found(), 600U);
}

TEST(LandmarkIndex, FindsThoseOnTheEdgesAndAtTheEndOfTheWorld) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Both both;
  const LandmarkSignature corner{true, 1.0};
  both.Grow(0, corner, {2.0, -4.0});  // Where four squares meet.
  both.Grow(1, corner, {1e9, 0.0});
  both.Grow(2, corner, {-1e7, 0.0});
  both.Grow(2, corner, {1e7, 0.0});
  both.Grow(3, corner, {0.0, 0.0});
  both.Grow(3, corner, {500.0, 500.0});
  both.Grow(3, corner, {900.0, 500.0});
  for (const Eigen::Vector2d& p :
       {Eigen::Vector2d(2.0, -4.0), Eigen::Vector2d(1e9, 0.0), Eigen::Vector2d(300.0, 300.0)})
    both.ExpectSame(corner, {p, p});
  both.ExpectSame(corner, {Eigen::Vector2d(2.0, -6.0), Eigen::Vector2d(4.0, -4.0)});
  both.ExpectSame(corner, {Eigen::Vector2d(-kInfinity, -kInfinity), Eigen::Vector2d(kInfinity, kInfinity)});
  both.ExpectSame(corner, {});
  both.ExpectSame({false, 1.0}, {Eigen::Vector2d(-1e3, -1e3), Eigen::Vector2d(1e3, 1e3)});
  EXPECT_EQ(both.found(), 8U);
}

}  // namespace
}  // namespace cairn::slam
