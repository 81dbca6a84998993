// Clouds as files other programs open: PLY (Stanford, 1994) and PCD (Point Cloud Library, version 0.7), each as text
// and as little-endian binary; x, y, z as 32-bit floats. Written beside the target and renamed (atomic). Numbers in
// text read back to the same float. Reading takes what this writes, and what other programs write of the same kind:
// binary little-endian or text, x, y, z among float properties; anything else is refused with a reason.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "common/cloud/point_cloud.h"
#include "common/status.h"

namespace cairn {

enum class CloudFormat { kPly = 0, kPlyText, kPcd, kPcdText };

// By the file's ending (.ply, .pcd), binary unless `text`.
[[nodiscard]] Result<CloudFormat> CloudFormatOf(const std::filesystem::path& path, bool text);

[[nodiscard]] std::string EncodeCloud(const PointCloud& cloud, CloudFormat format);
[[nodiscard]] Result<void> WriteCloud(const PointCloud& cloud, CloudFormat format, const std::filesystem::path& path);

// The format is recognised from the content.
[[nodiscard]] Result<PointCloud> DecodeCloud(std::string_view bytes);
[[nodiscard]] Result<PointCloud> ReadCloud(const std::filesystem::path& path);

}  // namespace cairn
