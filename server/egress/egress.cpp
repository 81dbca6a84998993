#include "server/egress/egress.h"

#include <algorithm>
#include <chrono>
#include <tuple>
#include <utility>
#include <variant>

namespace cairn::server {
namespace {

constexpr auto kGoodbyePatience = std::chrono::milliseconds(200);

}  // namespace

struct Egress::Publications {
  template <typename Value>
  using Of = std::unique_ptr<wire::Publication<Value>>;

  std::tuple<Of<SessionState>, Of<PoseReport>, Of<Ledger>, Of<Job>, Of<MapInfo>, Of<TileSample>, Of<Reply>> of;

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
};

Result<std::unique_ptr<Egress>> Egress::Open(wire::Bus& bus, Outbound& outbound) {
  auto publications = std::make_unique<Publications>();
  if (auto advertised = publications->AdvertiseAll(bus, publications->of); !advertised) {
    return tl::unexpected(advertised.error());
  }
  return std::unique_ptr<Egress>(new Egress(outbound, std::move(publications)));
}

Egress::Egress(Outbound& outbound, std::unique_ptr<Publications> publications)
    : outbound_(outbound), publications_(std::move(publications)) {
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
  const auto deadline = std::chrono::steady_clock::now() + kGoodbyePatience;
  const auto heard = [&deadline](auto& publication) {
    const auto left = deadline - std::chrono::steady_clock::now();
    static_cast<void>(publication->WaitForAcknowledgement(
        std::max(std::chrono::milliseconds(0), std::chrono::duration_cast<std::chrono::milliseconds>(left))));
  };
  heard(std::get<Publications::Of<Ledger>>(publications_->of));
  heard(std::get<Publications::Of<SessionState>>(publications_->of));
}

void Egress::Run(BoundedChannel<OutboundValue>& lane) {
  while (const auto value = lane.Pop()) {
    const bool published = std::visit(
        [this](const auto& alternative) {
          using Value = std::decay_t<decltype(alternative)>;
          return std::get<Publications::Of<Value>>(publications_->of)->Publish(alternative).has_value();
        },
        *value);
    if (published) continue;
    unpublished_.fetch_add(1, std::memory_order_relaxed);
    // While the server stops, it does not wait for a reader that takes nothing.
    if (lane.closed()) return;
  }
}

}  // namespace cairn::server
