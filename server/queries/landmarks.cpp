#include "server/queries/landmarks.h"

#include "server/queries/answer.h"
#include "server/queries/area.h"

namespace cairn::server {

Reply AnswerLandmarks(const Request& request, const std::vector<SessionSnapshot>& sessions) {
  if (!IsValid(request.area)) {
    return ReplyTo(request,
                   {StatusCode::kInvalidArgument, "the area is not finite or its minimum exceeds its maximum"});
  }
  Reply reply = ReplyTo(request);
  const bool everywhere = IsEverywhere(request.area);
  for (const SessionSnapshot& session : sessions) {
    if (session.status.session.site != request.site) continue;
    for (const LandmarkReport& landmark : *session.landmarks) {
      const Area point{landmark.p_map.x(), landmark.p_map.y(), landmark.p_map.x(), landmark.p_map.y()};
      if (everywhere || Overlap(request.area, point)) reply.landmarks.push_back(landmark);
    }
  }
  return reply;
}

}  // namespace cairn::server
