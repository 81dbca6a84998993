#include "client/lib/map_client.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>

#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"

namespace cairn::client {
namespace {

using namespace test;

MapInfo Hall(std::uint32_t epoch, std::uint64_t version, std::uint32_t tiles) {
  MapInfo info;
  info.site_id = HashName("hall");
  info.site = "hall";
  info.epoch = epoch;
  info.version = version;
  info.tile_count = tiles;
  return info;
}

TileSample TileAt(int x, std::uint32_t epoch, std::uint64_t version) {
  TileSample sample;
  sample.site_id = HashName("hall");
  sample.tile.key = {0, x, -x};
  sample.tile.epoch = epoch;
  sample.tile.version = version;
  sample.tile.bytes.assign(2000, static_cast<std::uint8_t>(x));
  return sample;
}

TEST(MapClient, ALateJoinerGetsTheWholeMapAndThenTheChanges) {
  FakeServer server(LoopbackOptions());
  for (int x = 0; x < 200; ++x) server.Publish(TileAt(x, 0, static_cast<std::uint64_t>(x) + 1));
  server.Publish(Hall(0, 200, 200));
  const auto bus = MakeBus("client");
  std::atomic<int> changes = 0;
  const auto client = Must(MapClient::Create(*bus, "hall", [&] { ++changes; }));
  Must(client->WaitComplete(20.0));
  EXPECT_EQ(client->tiles(0).size(), 200U);
  EXPECT_EQ(client->info()->site, "hall");
  server.Publish(TileAt(7, 0, 201));
  EXPECT_TRUE(Eventually([&] { return client->version() == 201; }));
  // 200 tiles, the map's word, the change.
  EXPECT_TRUE(Eventually([&] { return changes == 202; }));
}

TEST(MapClient, ANewEpochReplacesTheMapWhole) {
  FakeServer server(LoopbackOptions());
  for (int x = 0; x < 10; ++x) server.Publish(TileAt(x, 0, 1));
  server.Publish(Hall(0, 1, 10));
  const auto bus = MakeBus("client");
  const auto client = Must(MapClient::Create(*bus, "hall"));
  Must(client->WaitComplete(20.0));
  server.Publish(Hall(1, 2, 1));
  server.Publish(TileAt(3, 1, 2));
  EXPECT_TRUE(Eventually([&] { return client->epoch() == 1 && client->tiles().size() == 1; }));
  Must(client->WaitComplete(20.0));
}

// The reader of tiles can become deaf by itself, while descriptions of the map arrive without a pause.
TEST(MapClient, WhereOnlyTheDescriptionsArriveItJoinsAnew) {
  FakeServer server(LoopbackOptions());
  server.Publish(TileAt(3, 0, 1));
  server.Publish(Hall(0, 1, 1));
  const auto bus = MakeBus("client");
  const auto client = Must(MapClient::Create(*bus, "hall"));
  Must(client->WaitComplete(20.0));
  auto next = std::chrono::steady_clock::now();
  std::uint64_t version = 1;
  EXPECT_TRUE(Eventually([&] {
    if (std::chrono::steady_clock::now() >= next) {
      server.Publish(Hall(0, ++version, 1));
      next += std::chrono::milliseconds(200);
    }
    return client->renewed() > 0;
  }));
  server.Publish(TileAt(3, 0, version));
  Must(client->WaitComplete(20.0));
  EXPECT_EQ(client->version(), version);
}

// All tiles may have been deleted, and the newest one before the server was started.
TEST(MapClient, WhereNoTileIsMissingItStays) {
  FakeServer server(LoopbackOptions());
  server.Publish(Hall(0, 5, 0));
  const auto bus = MakeBus("client");
  const auto client = Must(MapClient::Create(*bus, "hall"));
  ASSERT_TRUE(Eventually([&] { return client->info().has_value(); }));
  // Longer than it takes to join anew where only descriptions arrive.
  EXPECT_FALSE(Eventually([&] { return client->renewed() > 0; }, std::chrono::seconds(6)));
}

// Everything of an earlier generation of the server is ignored, so a forged later one would hide the map for ever.
TEST(MapClient, AForgedMapOfALaterGenerationIsReplacedByTheServersOwn) {
  FakeServer server(LoopbackOptions());
  server.Publish(TileAt(3, 0, 1));
  server.Publish(Hall(0, 1, 1));
  const auto bus = MakeBus("client"), forger = MakeBus("forger");
  const auto client = Must(MapClient::Create(*bus, "hall"));
  Must(client->WaitComplete(20.0));
  auto forged = Must(forger->Advertise<MapInfo>());
  ASSERT_TRUE(Eventually([&] { return forged->matched() > 0; }));
  MapInfo later = Hall(7, 100, 0);
  later.generation = 9;
  Must(forged->Publish(later));
  ASSERT_TRUE(Eventually([&] { return client->epoch() == 7; }));
  forged.reset();
  EXPECT_TRUE(Eventually([&] { return client->renewed() > 0 && client->epoch() == 0 && client->tiles().size() == 1; }));
}

TEST(MapClient, SaysWhatIsMissing) {
  const auto bus = MakeBus("client");
  const auto client = Must(MapClient::Create(*bus, "hall"));
  EXPECT_EQ(client->WaitComplete(0.1).error().code, StatusCode::kUnavailable);
  FakeServer server(LoopbackOptions());
  EXPECT_TRUE(Eventually([&] { return client->WaitComplete(0.05).error().code == StatusCode::kNotFound; }));
  server.Publish(Hall(0, 1, 10));
  EXPECT_TRUE(Eventually([&] { return client->WaitComplete(0.05).error().code == StatusCode::kDeadlineExceeded; }));
}

}  // namespace
}  // namespace cairn::client
