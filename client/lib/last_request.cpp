#include "client/lib/last_request.h"

#include <cstdint>
#include <utility>

#include "common/service/request_id.h"

namespace cairn::client {
namespace {

struct SentRequest {
  ClientId client = 0;  // 0: nothing was sent.
  std::int64_t sequence = 0;
  bool command = false;
};

thread_local SentRequest last_sent;

}  // namespace

void NoteRequest(const Request& request) {
  const bool command = IsCommand(request.kind);
  // After a command, the client often asks how things are now.
  if (last_sent.command && !command) return;
  last_sent = {request.client, request.sequence, command};
}

std::string TakeLastRequest() {
  const SentRequest sent = std::exchange(last_sent, {});
  return sent.client == 0 ? std::string() : RequestId(sent.client, sent.sequence);
}

}  // namespace cairn::client
