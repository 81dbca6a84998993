// Which of the estimator's options the joint smoothing of several sessions takes over.
#pragma once

#include "server/slam/mapper_options.h"
#include "server/slam/site/site_options.h"

namespace cairn::slam {

[[nodiscard]] inline SiteOptions SiteOptionsOf(const MapperOptions& options) {
  return {.loop = options.loop,
          .revisit = options.revisit,
          .place = options.recovery.place,
          .self_check = options.self_check,
          .align = options.front_end.refine,
          .surface = options.front_end.surface,
          .drift = options.filter.back_end.drift,
          .pose_graph = options.pose_graph};
}

}  // namespace cairn::slam
