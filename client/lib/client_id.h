// The identity of a client process on the wire, and the message for a server that is not found.
#pragma once

#include <string>

#include "common/service/session.h"
#include "common/wire/bus.h"

namespace cairn::client {

// A random number, not zero, drawn from the operating system so that two processes do not get the same one.
[[nodiscard]] ClientId NewClientId();

// "no server answers on domain 0 at 127.0.0.1 within 2 s".
[[nodiscard]] std::string NoServer(const wire::Bus& bus, double timeout_s);

}  // namespace cairn::client
