#include "common/wire/writer_clients.h"

#include <gtest/gtest.h>

namespace cairn::wire {
namespace {

WriterClients::Writer Handle(std::uint8_t n) {
  WriterClients::Writer handle;
  handle.value[15] = n;
  return handle;
}

TEST(WriterClients, NameTheClientWhoseLeaseRanOutAndCameBack) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), 11));
  EXPECT_TRUE(clients.Seen(Handle(2), 22));
  EXPECT_EQ(clients.Changed({Handle(2), false, false}), ClientId{22});
  EXPECT_EQ(clients.Changed({Handle(2), true, false}), ClientId{22});
}

TEST(WriterClients, SayNothingTwice) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), 11));
  EXPECT_EQ(clients.Changed({Handle(1), true, false}), std::nullopt);
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), ClientId{11});
  EXPECT_EQ(clients.Changed({Handle(1), false, true}), std::nullopt);
}

TEST(WriterClients, KnowALeaseThatRanOutBeforeTheRequestWasRead) {
  WriterClients clients;
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), std::nullopt);
  EXPECT_FALSE(clients.Seen(Handle(1), 11));
}

TEST(WriterClients, ForgetWritersThatAreGone) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), 11));
  EXPECT_EQ(clients.Changed({Handle(1), false, true}), ClientId{11});
  EXPECT_EQ(clients.Changed({Handle(1), true, false}), std::nullopt);
}

// A client that joined the domain anew was taken for gone when its first participant left.
TEST(WriterClients, AClientIsAliveWhileOneOfItsWritersIs) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), 11));
  EXPECT_TRUE(clients.Seen(Handle(2), 11));
  EXPECT_EQ(clients.Changed({Handle(1), false, true}), std::nullopt);
  EXPECT_EQ(clients.Changed({Handle(2), false, false}), ClientId{11});
  EXPECT_TRUE(clients.Seen(Handle(3), 11));
}

TEST(WriterClients, FollowTheLastClientAWriterNamed) {
  WriterClients clients;
  EXPECT_TRUE(clients.Seen(Handle(1), 11));
  EXPECT_TRUE(clients.Seen(Handle(1), 12));
  EXPECT_EQ(clients.Changed({Handle(1), false, false}), ClientId{12});
}

}  // namespace
}  // namespace cairn::wire
