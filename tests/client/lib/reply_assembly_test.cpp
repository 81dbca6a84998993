#include "client/lib/reply_assembly.h"

#include <gtest/gtest.h>

namespace cairn::client {
namespace {

Reply Part(std::uint32_t number, bool last) {
  Reply part;
  part.part = number;
  part.last = last;
  part.map_version = number;
  part.path = {{static_cast<Stamp>(number), {}}};
  return part;
}

TEST(ReplyAssembly, ASinglePartIsComplete) {
  ReplyAssembly assembly;
  EXPECT_FALSE(assembly.complete());
  assembly.Add(Part(0, true));
  EXPECT_TRUE(assembly.complete());
}

TEST(ReplyAssembly, PartsInAnyOrderMakeTheListInOrder) {
  ReplyAssembly assembly;
  assembly.Add(Part(2, true));
  assembly.Add(Part(0, false));
  EXPECT_FALSE(assembly.complete());
  assembly.Add(Part(1, false));
  ASSERT_TRUE(assembly.complete());
  const Reply whole = assembly.Take();
  ASSERT_EQ(whole.path.size(), 3U);
  for (Stamp i = 0; i < 3; ++i) EXPECT_EQ(whole.path[static_cast<std::size_t>(i)].stamp, i);
  EXPECT_EQ(whole.map_version, 2U);
}

TEST(ReplyAssembly, RepeatedPartsCountOnce) {
  ReplyAssembly assembly;
  assembly.Add(Part(0, false));
  assembly.Add(Part(0, false));
  assembly.Add(Part(1, true));
  EXPECT_EQ(assembly.Take().path.size(), 2U);
}

TEST(ReplyAssembly, AMissingPartIsMissed) {
  ReplyAssembly assembly;
  assembly.Add(Part(0, false));
  assembly.Add(Part(2, true));
  EXPECT_FALSE(assembly.complete());
}

TEST(ReplyAssembly, TheLastPartSaysHowItEnded) {
  ReplyAssembly assembly;
  assembly.Add(Part(0, false));
  Reply last = Part(1, true);
  last.status = {StatusCode::kAborted, "the map changed"};
  assembly.Add(std::move(last));
  EXPECT_EQ(assembly.Take().status.code, StatusCode::kAborted);
}

TEST(ReplyAssembly, AbsurdPartNumbersAreIgnored) {
  ReplyAssembly assembly;
  assembly.Add(Part(0xffffffffU, true));
  EXPECT_EQ(assembly.parts(), 0U);
}

}  // namespace
}  // namespace cairn::client
