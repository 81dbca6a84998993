#include "server/maps/layer_sum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

namespace cairn::server {
namespace {

// What the rules of layer_sum.h say of one cell.
int PlainSum(int sum, int later, int most) {
  if (later == slam::kUnseen) return sum;
  if (sum == slam::kUnseen) return later;
  return std::clamp(std::clamp(sum, -most, most) + later, -kLargestSum, kLargestSum);
}

// The loop is written for vector instructions.
TEST(LayerSum, IsThatOfThePlainRules) {
  constexpr std::array<int, 9> kCells = {slam::kUnseen, -kLargestSum,    -500,       -1, 0, 1,
                                         700,           kLargestSum - 1, kLargestSum};
  std::mt19937 random(1);
  const auto any = [&] {
    const std::uint32_t draw = random();
    if (draw % 2 == 0) return kCells.at(draw / 2 % kCells.size());
    return static_cast<int>(draw / 2 % (2 * kLargestSum + 1)) - kLargestSum;
  };
  for (const int most : {0, 85, 1000, kLargestSum}) {
    slam::GridChunk before = UnseenChunk(), later = UnseenChunk();
    for (auto* const chunk : {&before, &later})
      std::ranges::generate(chunk->log_odds, [&] { return static_cast<std::int16_t>(any()); });
    slam::GridChunk sum = before;
    AddLater(sum, later, most, [](std::size_t cell) { return cell % 3 != 0; });
    for (std::size_t cell = 0; cell < sum.log_odds.size(); ++cell) {
      const int a = before.log_odds[cell], b = later.log_odds[cell];
      ASSERT_EQ(sum.log_odds[cell], cell % 3 != 0 ? PlainSum(a, b, most) : a) << a << ' ' << b << ' ' << most;
    }
  }
}

}  // namespace
}  // namespace cairn::server
