#include "server/queries/status.h"

#include "server/queries/answer.h"

namespace cairn::server {

Reply AnswerStatus(const Request& request, const std::vector<SessionSnapshot>& sessions) {
  Reply reply = ReplyTo(request);
  for (const SessionSnapshot& session : sessions) {
    if (request.site.empty() || session.status.session.site == request.site) reply.robots.push_back(session.status);
  }
  return reply;
}

}  // namespace cairn::server
