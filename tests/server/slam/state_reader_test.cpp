#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

// The parts that were not read are in any state, and their indices may be anything.
TEST(StateReader, WhatMustHoldIsNotAskedAfterAFailure) {
  StateWriter writer;
  writer(std::uint64_t{7});
  const std::string bytes = writer.Bytes();
  int asked = 0;
  const auto holds = [&asked] { return ++asked > 0; };
  StateReader reader(bytes);
  std::uint64_t number = 0;
  reader(number);
  EXPECT_TRUE(reader.RequireThat(holds, "seven"));
  reader(number);
  EXPECT_FALSE(reader.RequireThat(holds, "eight"));
  EXPECT_EQ(asked, 1);
  EXPECT_STREQ(reader.failed(), "the length");
}

}  // namespace
}  // namespace cairn::slam
