#include "server/ops/domain_lock.h"

#include <gtest/gtest.h>
#include <unistd.h>

namespace cairn::server {
namespace {

// Far from any real domain, and this process's own.
const std::int64_t kNobodys = 1'000'000 + getpid();

TEST(DomainLock, IsHeldOnceAnAddressAndGoesWithItsHolder) {
  {
    const auto held = DomainLock::Take(kNobodys, {"127.0.0.1", "10.0.0.1"});
    ASSERT_TRUE(held);
    const auto second = DomainLock::Take(kNobodys, {"10.0.0.1"});
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, StatusCode::kAlreadyExists);
    EXPECT_TRUE(DomainLock::Take(kNobodys, {"10.0.0.2"}));
    EXPECT_TRUE(DomainLock::Take(kNobodys + 10'000'000, {"127.0.0.1"}));
  }
  EXPECT_TRUE(DomainLock::Take(kNobodys, {"127.0.0.1"}));
}

}  // namespace
}  // namespace cairn::server
