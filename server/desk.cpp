#include "server/desk.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "common/version.h"
#include "server/queries/answer.h"
#include "server/queries/jobs.h"
#include "server/queries/reply_parts.h"

namespace cairn::server {

Desk::Desk(std::size_t capacity, Outbound& outbound, DeskPorts ports)
    : outbound_(outbound), ports_(std::move(ports)), requests_(capacity) {}

Desk::~Desk() {
  Stop();
}

void Desk::Start() {
  thread_ = std::jthread([this] {
    while (const auto request = requests_.Pop()) Serve(*request);
  });
}

void Desk::Take(Request&& request) {
  Reply busy = ReplyTo(request, {StatusCode::kResourceExhausted, "too many requests are waiting; try again"});
  if (!requests_.TryPush(std::move(request))) outbound_.Send(std::move(busy));
}

void Desk::Stop() {
  requests_.Close();
  if (thread_.joinable()) thread_.join();
}

void Desk::Serve(const Request& request) {
  Reply reply;
  switch (request.kind) {
    case RequestKind::kPing:
      reply = ReplyTo(request);
      reply.server_version = kVersion;
      break;
    case RequestKind::kJobSubmit:
      reply = AnswerJob(request, ports_.submit_job(request.site, request.job_kind, request.enable));
      break;
    case RequestKind::kJobCancel:
      reply = AnswerJob(request, ports_.cancel_job(request.job));
      break;
    case RequestKind::kSessionEnd: {
      const auto ended = ports_.end_session(request.robot);
      reply = ReplyTo(request, ended ? Status{} : ended.error());
      break;
    }
    case RequestKind::kMapEnable:
      EnableMap(request);
      return;
    default:
      reply = Answer(request, ports_.views);
  }
  for (Reply& part : SplitReply(std::move(reply))) outbound_.SendPatiently(std::move(part));
}

void Desk::EnableMap(const Request& request) {
  ports_.enable_map(request.site, request.map_version, [&outbound = outbound_, request](Result<std::uint32_t> enabled) {
    Reply reply = ReplyTo(request, enabled ? Status{} : enabled.error());
    if (enabled) spdlog::info("site {}: map version {} is enabled", request.site, *enabled);
    outbound.Send(std::move(reply));
  });
}

}  // namespace cairn::server
