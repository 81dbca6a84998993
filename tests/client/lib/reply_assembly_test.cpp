#include "client/lib/reply_assembly.h"

#include <gtest/gtest.h>

#include "tests/common/wire/sample_values.h"

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

TEST(ReplyAssembly, NothingOfAReplyIsLost) {
  Reply reply = wire::ExtremeReply();
  reply.part = 0;
  reply.last = true;
  ReplyAssembly assembly;
  assembly.Add(Reply(reply));
  const Reply whole = assembly.Take();
  Reply expected = reply;
  expected.part = whole.part;
  expected.last = whole.last;
  EXPECT_TRUE(wire::Same(whole, expected));
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

// A server that was started anew answers the repeated question. Parts of its answer and of the earlier server's must
// not be mixed.
TEST(ReplyAssembly, AllPartsAreOfOneServer) {
  const auto of = [](Generation generation, std::uint32_t number, bool last) {
    Reply part = Part(number, last);
    part.generation = generation;
    return part;
  };
  ReplyAssembly assembly;
  assembly.Add(of(5, 0, false));
  assembly.Add(of(5, 2, true));
  assembly.Add(of(6, 1, true));
  EXPECT_FALSE(assembly.complete());
  assembly.Add(of(5, 1, false));
  EXPECT_FALSE(assembly.complete()) << "what an earlier server has sent comes too late";
  assembly.Add(of(6, 0, false));
  ASSERT_TRUE(assembly.complete());
  const Reply whole = assembly.Take();
  EXPECT_EQ(whole.generation, 6U);
  EXPECT_EQ(whole.path.size(), 2U);
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
