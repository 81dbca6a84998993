#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "common/options/config.h"
#include "common/wire/bus.h"

namespace cairn::wire {
namespace {

TEST(WireOptions, DefaultsAreValid) {
  EXPECT_TRUE(Validate(WireOptions{}));
  EXPECT_TRUE(RequireInterfaces(WireOptions{}));
}

TEST(WireOptions, TellAnAddressThisMachineDoesNotHaveFromOneThatIsNone) {
  WireOptions options;
  options.interfaces = {"127.0.0.1", "192.0.2.1"};  // TEST-NET-1: nobody's.
  EXPECT_TRUE(Validate(options));
  const Result<void> present = RequireInterfaces(options);
  ASSERT_FALSE(present);
  EXPECT_EQ(present.error().code, StatusCode::kUnavailable);
  EXPECT_THAT(present.error().message, ::testing::HasSubstr("192.0.2.1"));
  for (const char* none : {"eth0", "localhost", "192.0.2", "192.0.2.256", "::1", "127.0.0.1 "}) {
    options.interfaces = {"127.0.0.1", none};
    const Result<void> valid = Validate(options);
    ASSERT_FALSE(valid) << none;
    EXPECT_EQ(valid.error().message, "wire.interfaces: '" + std::string(none) + "' is not an IPv4 address");
  }
}

// The lock of the domain would take the second for another server's.
TEST(WireOptions, RefuseAnAddressNamedTwice) {
  WireOptions options;
  options.interfaces = {"127.0.0.1", "127.0.0.1"};
  EXPECT_FALSE(Validate(options));
}

TEST(WireOptions, RefuseNoAddressAtAll) {
  WireOptions options;
  options.interfaces.clear();
  EXPECT_FALSE(Validate(options));
}

TEST(WireOptions, RefuseDomainsAndLeasesOutOfRange) {
  WireOptions options;
  options.domain = 233;
  EXPECT_FALSE(Validate(options));
  options.domain = -1;
  EXPECT_FALSE(Validate(options));
  options = {};
  options.liveliness_lease_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Validate(options));
  options = {};
  options.participant_lease_s = 0.0;
  EXPECT_FALSE(Validate(options));
}

TEST(WireOptions, ReadDiscoveryServers) {
  WireOptions options;
  options.discovery_servers = {"10.0.0.5", "10.0.0.6:11812"};
  EXPECT_TRUE(Validate(options));
  for (const char* wrong : {"", "mapper", "10.0.0.5:", "10.0.0.5:0", "10.0.0.5:65536", "10.0.0.5:1x", "10.0.0.5:1:2"}) {
    options.discovery_servers = {wrong};
    const Result<void> valid = Validate(options);
    ASSERT_FALSE(valid) << wrong;
    EXPECT_THAT(valid.error().message, ::testing::StartsWith("wire.discovery_servers: '" + std::string(wrong) + "'"));
  }
}

// Members of a fleet would not trust it, and nobody would find anybody.
TEST(WireOptions, RefuseADiscoveryServerInASecuredFleet) {
  WireOptions options;
  options.discovery_servers = {"10.0.0.5"};
  options.security = "/etc/cairn/security";
  EXPECT_FALSE(Validate(options));
}

TEST(WireOptions, ABusWithInvalidOptionsIsNotMade) {
  WireOptions options;
  for (const char* address : {"not-an-address", "192.0.2.1"}) {
    options.interfaces = {address};
    EXPECT_FALSE(Bus::Create(options, "test")) << address;
  }
}

TEST(WireOptions, ReadInterfacesAsOneCommaSeparatedText) {
  WireOptions options;
  const VisitOptions visit = [&](OptionVisitor& visitor) { Visit(visitor, options); };
  const Result<void> result = ApplySet({"interfaces=127.0.0.1, 10.0.0.5", "domain=7"}, visit);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_THAT(options.interfaces, ::testing::ElementsAre("127.0.0.1", "10.0.0.5"));
  EXPECT_EQ(options.domain, 7);
}

}  // namespace
}  // namespace cairn::wire
