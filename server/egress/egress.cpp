#include "server/egress/egress.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <optional>
#include <tuple>
#include <utility>
#include <variant>

#include "server/egress/generation_stamp.h"
#include "server/egress/unsent.h"

namespace cairn::server {
namespace {

constexpr auto kLastMessagesPatience = std::chrono::milliseconds(200);

}  // namespace

struct Egress::Publications {
  template <typename Value>
  using Of = std::unique_ptr<wire::Publication<Value>>;

  std::tuple<Of<SessionState>, Of<SessionRefusal>, Of<PoseReport>, Of<Ledger>, Of<Job>, Of<MapInfo>, Of<TileSample>,
             Of<Reply>>
      of;

  template <typename Value>
  Result<void> Advertise(wire::Bus& bus) {
    auto publication = bus.Advertise<Value>();
    if (!publication) return tl::unexpected(publication.error());
    std::get<Of<Value>>(of) = std::move(*publication);
    return {};
  }

  // Advertises all topics; stops at the first failure.
  template <typename... Values>
  Result<void> AdvertiseAll(wire::Bus& bus, std::tuple<Of<Values>...>& /*types*/) {
    Result<void> result;
    static_cast<void>((... && (result = Advertise<Values>(bus)).has_value()));
    return result;
  }

  template <typename Value>
  Result<void> Publish(const Value& value) {
    return std::get<Of<Value>>(of)->Publish(value);
  }
  template <typename Value>
  Result<void> Retire(const Value& value) {
    return std::get<Of<Value>>(of)->Retire(value);
  }
  Result<void> Publish(const Retired& retired) {
    Result<void> result = std::visit([this](const auto& value) { return Retire(value); }, retired.of);
    if (!result && result.error().code == StatusCode::kNotFound) return {};
    return result;
  }
};

// The sender of one lane: what its thread does with each value, and the state that it needs for this.
class Egress::Door {
 public:
  Door(Publications& publications, Generation generation) : publications_(publications), generation_(generation) {}

  [[nodiscard]] bool waiting() const { return !unsent_.empty(); }

  bool Send(OutboundValue value) {
    Stamp(value, generation_);
    const Result<void> published = std::visit([this](const auto& one) { return publications_.Publish(one); }, value);
    // A value beyond the wire's limits will never be accepted.
    if (!published && published.error().code == StatusCode::kUnavailable) {
      unsent_.Keep(std::move(value));
    } else {
      unsent_.Forget(value);
    }
    return published.has_value();
  }

  // The kept states, until kMaxFailures of them are refused again: each may block the lane for a while.
  void SendAgain() {
    constexpr int kMaxFailures = 4;
    int failures = 0;
    while (failures < kMaxFailures) {
      std::optional<OutboundValue> value = unsent_.After(last_tried_);
      last_tried_ = value ? Unsent::KeyOf(*value) : std::nullopt;
      if (!value) return;
      failures += Send(*std::move(value)) ? 0 : 1;
    }
  }

 private:
  Publications& publications_;
  const Generation generation_;
  Unsent unsent_;
  std::optional<Unsent::Key> last_tried_;  // Empty: the next round begins with the first one.
};

Result<std::unique_ptr<Egress>> Egress::Open(wire::Bus& bus, Outbound& outbound, Generation generation) {
  auto publications = std::make_unique<Publications>();
  if (auto advertised = publications->AdvertiseAll(bus, publications->of); !advertised) {
    return tl::unexpected(advertised.error());
  }
  return std::unique_ptr<Egress>(new Egress(outbound, std::move(publications), generation));
}

Egress::Egress(Outbound& outbound, std::unique_ptr<Publications> publications, Generation generation)
    : outbound_(outbound), generation_(generation), publications_(std::move(publications)) {
  for (const auto lane : {Outbound::Lane::kLive, Outbound::Lane::kMap, Outbound::Lane::kReplies}) {
    threads_.emplace_back([this, lane] { Run(outbound_.lane(lane)); });
  }
}

Egress::~Egress() {
  Finish();
}

void Egress::Finish() {
  if (threads_.empty()) return;
  threads_.clear();
  // Readers that still listen get the last states; one that does not answer may not delay the end for long.
  const auto deadline = std::chrono::steady_clock::now() + kLastMessagesPatience;
  const auto wait_for_readers = [&deadline](auto& publication) {
    const auto left = deadline - std::chrono::steady_clock::now();
    static_cast<void>(publication->WaitForAcknowledgement(
        std::max(std::chrono::milliseconds(0), std::chrono::duration_cast<std::chrono::milliseconds>(left))));
  };
  wait_for_readers(std::get<Publications::Of<Ledger>>(publications_->of));
  wait_for_readers(std::get<Publications::Of<SessionState>>(publications_->of));
}

void Egress::Run(BoundedChannel<OutboundValue>& lane) {
  Door door(*publications_, generation_);
  auto next_retry = std::chrono::steady_clock::now();
  for (;;) {
    std::optional<OutboundValue> value = door.waiting() ? lane.PopFor(kRetryPeriod) : lane.Pop();
    if (!value && (lane.closed() || !door.waiting())) return;
    try {
      if (value && !door.Send(*std::move(value))) {
        unpublished_.fetch_add(1, std::memory_order_relaxed);
        // While the server stops, it does not wait for a reader that takes nothing.
        if (lane.closed()) return;
      }
      if (!door.waiting() || std::chrono::steady_clock::now() < next_retry) continue;
      next_retry = std::chrono::steady_clock::now() + kRetryPeriod;
      door.SendAgain();
    } catch (const std::exception& error) {
      unpublished_.fetch_add(1, std::memory_order_relaxed);
      spdlog::error("a value could not be sent because of an exception: {}", error.what());
    }
  }
}

}  // namespace cairn::server
