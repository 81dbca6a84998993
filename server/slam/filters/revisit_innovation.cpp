#include "server/slam/filters/revisit_innovation.h"

#include "common/geometry/pose_difference.h"

namespace cairn::slam {

Innovation<3> InnovateRevisit(const Pose2& T_map_keyframe, const Pose2& T_map_robot,
                              const RevisitObservation& revisit) {
  Innovation<3> innovation;
  innovation.v = Minus(revisit.T_keyframe_robot, Between(T_map_keyframe, T_map_robot));
  innovation.J_z_pose = J_compose_right(T_map_keyframe.Inverse(), T_map_robot);
  innovation.S_known_pose = revisit.covariance;
  return innovation;
}

}  // namespace cairn::slam
