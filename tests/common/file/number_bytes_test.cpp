#include "common/file/number_bytes.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace cairn {
namespace {

// As files of other machines have them.
TEST(NumberBytes, TheLowestByteComesFirst) {
  EXPECT_EQ(BytesOfNumber(std::uint32_t{0x01020304}), std::string("\4\3\2\1"));
  EXPECT_EQ(BytesOfNumber(std::uint64_t{1}).size(), 8U);
}

TEST(NumberBytes, NumbersAreTakenOneAfterTheOther) {
  const std::string all = BytesOfNumber(std::uint64_t{1} << 63) + BytesOfNumber(-0.1) + BytesOfNumber(std::int16_t{-2});
  std::string_view rest = all;
  EXPECT_EQ(TakeNumber<std::uint64_t>(rest), std::uint64_t{1} << 63);
  EXPECT_EQ(TakeNumber<double>(rest), -0.1);
  EXPECT_FALSE(TakeNumber<std::uint32_t>(rest)) << "two bytes are left";
  EXPECT_EQ(rest.size(), 2U);
  EXPECT_EQ(TakeNumber<std::int16_t>(rest), std::int16_t{-2});
  EXPECT_TRUE(rest.empty());
}

}  // namespace
}  // namespace cairn
