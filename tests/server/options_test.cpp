// Options of the server that contradict each other, and what its operators read.
#include "server/options.h"

#include <gtest/gtest.h>

#include "common/options/config.h"

namespace cairn::server {
namespace {

// The first contradiction after these assignments; empty: none.
std::string Contradiction(const std::vector<std::string>& assignments) {
  ServerOptions options;
  const VisitOptions visit = [&](OptionVisitor& visitor) { Visit(visitor, options); };
  const auto applied = ApplySet(assignments, visit);
  EXPECT_TRUE(applied) << applied.error().message;
  const auto checked = CheckRules(visit);
  return checked ? "" : checked.error().message;
}

TEST(ServerOptions, TheDefaultsContradictNothing) {
  EXPECT_EQ(Contradiction({}), "");
}

TEST(ServerOptions, ASiteMustBePossible) {
  EXPECT_EQ(Contradiction({"server.create_sites=false"}),
            "server.create_sites (false) leaves no site without a name in server.sites (\"\")");
  EXPECT_EQ(Contradiction({"server.create_sites=false", "server.sites=a"}), "");
  EXPECT_EQ(Contradiction({"server.sites=a,b,c", "maps.max_sites=2"}),
            "server.sites (\"a,b,c\") must not have more names than maps.max_sites (2)");
  EXPECT_EQ(Contradiction({"server.sites=a,b,c", "maps.max_sites=3"}), "");
}

TEST(ServerOptions, EveryRobotFindsRoomForAMessage) {
  EXPECT_EQ(Contradiction({"server.inbound_capacity=255"}),
            "server.inbound_capacity (255) must be at least robots.max_robots (256)");
  EXPECT_EQ(Contradiction({"server.outbound_capacity=255"}),
            "server.outbound_capacity (255) must be at least robots.max_robots (256)");
  EXPECT_EQ(Contradiction({"server.outbound_capacity=256", "server.inbound_capacity=256"}), "");
}

TEST(ServerOptions, MoreJobsAreKeptThanWait) {
  EXPECT_EQ(Contradiction({"jobs.max_queued=256"}), "jobs.max_queued (256) must be below half of jobs.max_kept (256)");
  EXPECT_EQ(Contradiction({"jobs.max_queued=127"}), "");
}

TEST(ServerOptions, RulesOfTheEstimatorCountToo) {
  EXPECT_EQ(Contradiction({"slam.grid.hit_probability=0.985"}),
            "slam.grid.hit_probability (0.985) must not exceed slam.grid.clamp_probability (0.98)");
}

}  // namespace
}  // namespace cairn::server
