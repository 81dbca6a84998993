// What a thread has asked the server last, so that a program can name it to people, who find it in the server's log.
// Thread rule: any thread; each has its own.
#pragma once

#include <string>

#include "common/service/request.h"

namespace cairn::client {

// QueryClient calls it for every question and command that it sends, except for the pings that look for the server.
void NoteRequest(const Request& request);

// The id (RequestId) of the last command that the calling thread has sent since it called this last, or of the last
// question if it has sent no command. Empty if it has sent nothing.
std::string TakeLastRequest();

}  // namespace cairn::client
