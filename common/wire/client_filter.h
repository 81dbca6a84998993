// Keeps replies to other clients off the network: the reader of a client tells the writers which client it is, and a
// Fast DDS writer sends it nothing else. Writers of other vendors send everything; SampleType skips what is foreign.
// This header uses the Fast DDS 2.x API; include it only inside common/wire.
// Source: DDS 1.4, 2.2.2.3.3 (content-filtered topics), with a filter class of our own, because the standard's SQL
// would be parsed by the server as any peer sends it. An expression of this class is a decimal number.
#pragma once

#include <fastdds/dds/topic/IContentFilterFactory.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "common/service/session.h"

namespace cairn::wire {

inline constexpr const char* kClientFilterClass = "CAIRN_CLIENT";

// The expression of the filter for one client, and the client of an expression; nothing if it is not one.
[[nodiscard]] std::string ClientExpression(ClientId client);
[[nodiscard]] std::optional<ClientId> ClientOfExpression(std::string_view expression);

// Makes the filters of all participants of the process. Thread-safe, and never destroyed.
[[nodiscard]] eprosima::fastdds::dds::IContentFilterFactory& ClientFilters();

}  // namespace cairn::wire
