// Who a client process is on the wire.
#pragma once

#include <string>

#include "common/service/session.h"
#include "common/wire/bus.h"

namespace cairn::client {

// Random and non-zero; from the operating system, so two processes never share one.
[[nodiscard]] ClientId NewClientId();

// "no server answers on domain 0 at 127.0.0.1 within 2 s".
[[nodiscard]] std::string NoServer(const wire::Bus& bus, double timeout_s);

}  // namespace cairn::client
