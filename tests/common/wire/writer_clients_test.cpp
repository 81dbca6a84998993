#include "common/wire/writer_clients.h"

#include <gtest/gtest.h>

namespace cairn::wire {
namespace {

WriterClients::Writer Handle(std::uint8_t n) {
  WriterClients::Writer handle;
  handle.value[15] = n;
  return handle;
}

const std::vector<WriterClients::Speaker> kNobody;

std::vector<WriterClients::Speaker> Of(ClientId client) {
  return {{client, 1}};
}

TEST(WriterClients, NameTheClientWhoseLeaseRanOutAndCameBack) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 1}));
  EXPECT_TRUE(clients.Seen(Handle(2), {22, 1}));
  EXPECT_EQ(clients.Changed({Handle(2), false, false}), Of(22));
  EXPECT_EQ(clients.Changed({Handle(2), true, false}), Of(22));
}

TEST(WriterClients, SayNothingTwice) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 1}));
  EXPECT_EQ(clients.Changed({Handle(1), true, false}), kNobody);
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), Of(11));
  EXPECT_EQ(clients.Changed({Handle(1), false, true}), kNobody);
}

TEST(WriterClients, KnowALeaseThatRanOutBeforeTheRequestWasRead) {
  WriterClients clients;
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), kNobody);
  EXPECT_FALSE(clients.Seen(Handle(1), {11, 1}));
}

TEST(WriterClients, ForgetWritersThatAreGone) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 1}));
  EXPECT_EQ(clients.Changed({Handle(1), false, true}), Of(11));
  EXPECT_EQ(clients.Changed({Handle(1), true, false}), kNobody);
}

// A client that joined the domain anew was taken for gone when its first participant left.
TEST(WriterClients, AClientIsAliveWhileOneOfItsWritersIs) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 1}));
  EXPECT_TRUE(clients.Seen(Handle(2), {11, 1}));
  EXPECT_EQ(clients.Changed({Handle(1), false, true}), kNobody);
  EXPECT_EQ(clients.Changed({Handle(2), false, false}), Of(11));
  EXPECT_TRUE(clients.Seen(Handle(3), {11, 1}));
}

TEST(WriterClients, FollowTheLastClientAWriterNamed) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 1}));
  EXPECT_TRUE(clients.Seen(Handle(1), {12, 1}));
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), Of(12));
}

// Security says who may speak for a robot, and nothing about the numbers of clients.
TEST(WriterClients, WhoNamesTheClientOfAnotherRobotDoesNotKeepItAlive) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 1}));
  EXPECT_TRUE(clients.Seen(Handle(2), {11, 2}));
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), Of(11));
  EXPECT_FALSE(clients.Seen(Handle(1), {11, 1}));
}

TEST(WriterClients, OneWriterMaySpeakForSeveralRobots) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 1}));
  EXPECT_TRUE(clients.Seen(Handle(1), {11, 2}));
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), (std::vector<WriterClients::Speaker>{{11, 1}, {11, 2}}));
  EXPECT_EQ(clients.Changed({Handle(1), true, false}), (std::vector<WriterClients::Speaker>{{11, 1}, {11, 2}}));
}

}  // namespace
}  // namespace cairn::wire
