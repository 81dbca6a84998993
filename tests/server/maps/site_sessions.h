// A site with two sessions that the test plays.
#pragma once

#include <gtest/gtest.h>

#include <future>
#include <map>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include "server/maps/site.h"
#include "tests/server/maps/uniform_chunk.h"

namespace cairn::server::testing {

using Corrections = std::vector<std::pair<SessionId, Correction>>;

// A session that keeps its corrections and leaves the answers to the test.
class FakeSession : public GridOwner {
 public:
  FakeSession(SessionId id, Corrections& corrections) : id_(id), corrections_(corrections) {}
  void SetMapEpoch(std::uint32_t epoch) override { epoch_ = epoch; }
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  void Adopt(Correction&& correction) override { corrections_.emplace_back(id_, std::move(correction)); }

 private:
  const SessionId id_;
  Corrections& corrections_;
  std::uint32_t epoch_ = 0;
};

class SiteTest : public ::testing::Test {
 protected:
  SiteTest() {
    for (const SessionId id : {SessionId{1}, SessionId{2}}) {
      sessions_[id] = std::make_shared<FakeSession>(id, corrections_);
      site_->Join({.session = id, .robot = 100 + id, .owner = sessions_[id]});
    }
  }
  ~SiteTest() override { pool_.join(); }

  void Settle() {
    std::promise<void> reached;
    site_->Probe([&] { reached.set_value(); });
    reached.get_future().wait();
  }
  std::vector<TileSample> TakeTiles() {
    site_->Publish();
    Settle();
    std::vector<TileSample> tiles;
    while (auto value = outbound_.lane(Outbound::Lane::kMap).TryPop()) {
      if (auto* tile = std::get_if<TileSample>(&*value)) tiles.push_back(std::move(*tile));
    }
    return tiles;
  }
  std::future<Result<std::uint32_t>> Enable(std::uint32_t version) {
    const auto promise = std::make_shared<std::promise<Result<std::uint32_t>>>();
    site_->Enable(version, [promise](Result<std::uint32_t> result) { promise->set_value(std::move(result)); });
    Settle();
    return promise->get_future();
  }
  std::uint32_t AddVersion(std::map<SessionId, RobotGrid> parts) {
    std::promise<std::uint32_t> number;
    MapVersion version;
    version.parts = std::move(parts);
    site_->AddVersion(std::move(version), [&](Result<std::uint32_t> result) { number.set_value(*result); });
    return number.get_future().get();
  }

  static constexpr std::size_t kLane = 64;
  asio::thread_pool pool_{1};
  Outbound outbound_{kLane};
  Corrections corrections_;  // Written on the site's strand: read after Settle.
  std::map<SessionId, std::shared_ptr<FakeSession>> sessions_;
  std::shared_ptr<Site> site_ = std::make_shared<Site>("lab", 0.05, MapsOptions{.max_versions = 3}, pool_, outbound_);
};

}  // namespace cairn::server::testing
