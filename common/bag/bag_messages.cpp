#include "common/bag/bag_messages.h"

#include <utility>

#include "common/bag/foxglove_encoding.h"
#include "common/ros2/cdr_decoding.h"

namespace cairn::bag {

Result<ScanMessage> DecodeScan(const Topic& topic, std::string_view bytes) {
  if (topic.encoding == kProtobuf) return DecodeFoxgloveScan(bytes);
  auto scan = ros2::DecodeLaserScan(bytes);
  if (!scan) return tl::unexpected(scan.error());
  return ScanMessage{*std::move(scan)};
}

Result<ros2::Odometry> DecodeOdometry(const Topic& topic, std::string_view bytes) {
  return topic.encoding == kProtobuf ? DecodePoseInFrame(bytes) : ros2::DecodeOdometry(bytes);
}

Result<ros2::Transforms> DecodeTransforms(const Topic& topic, std::string_view bytes) {
  if (topic.encoding != kProtobuf) return ros2::DecodeTransforms(bytes);
  return topic.type == kTransformsSchema ? DecodeFrameTransforms(bytes) : DecodeFrameTransform(bytes);
}

}  // namespace cairn::bag
