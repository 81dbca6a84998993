// Over real DDS on loopback: who counts as a server is decided by what DDS says of its peers.
#include "server/ingress/other_servers.h"

#include <gtest/gtest.h>

#include "server/ingress/ingress.h"
#include "tests/loopback.h"

namespace cairn::server {
namespace {

using test::Eventually;
using test::Must;

// As much of a server as others see: the door inwards.
struct Door {
  std::unique_ptr<wire::Bus> bus = test::MakeBus("cairnd");
  Inbound inbound{8};
  Outbound outbound{8};
  std::unique_ptr<OtherServers> others = Must(OtherServers::Watch(*bus));
  std::unique_ptr<Ingress> ingress = Must(Ingress::Open(*bus, inbound, outbound));
};

TEST(OtherServers, NeitherItselfNorAClientIsOne) {
  Door server;
  const auto client = test::MakeBus("client");
  const auto requests = Must(client->Advertise<Request>());
  const auto replies = Must(client->Subscribe<Reply>([](Reply&&) {}));
  ASSERT_TRUE(Eventually([&] { return requests->matched() == 1; }));
  EXPECT_EQ(server.others->count(), 0);
  EXPECT_FALSE(server.others->Joined());
}

TEST(OtherServers, EachThatComesIsToldOnceByThoseThatAreThere) {
  Door first;
  {
    Door second;
    EXPECT_TRUE(Eventually([&] { return first.others->Joined(); }));
    EXPECT_TRUE(Eventually([&] { return second.others->Joined(); }));
    EXPECT_EQ(first.others->count(), 1);
    EXPECT_FALSE(first.others->Joined());
    const Door third;
    EXPECT_TRUE(Eventually([&] { return first.others->Joined(); }));
    EXPECT_EQ(first.others->count(), 2);
  }
  EXPECT_TRUE(Eventually([&] { return first.others->count() == 0; })) << "they are gone";
  EXPECT_FALSE(first.others->Joined());
  const Door fourth;
  EXPECT_TRUE(Eventually([&] { return first.others->Joined(); })) << "after the others went, one more is news";
}

}  // namespace
}  // namespace cairn::server
