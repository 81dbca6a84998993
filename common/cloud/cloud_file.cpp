#include "common/cloud/cloud_file.h"

#include <bit>
#include <cstring>

#include "common/file/atomic_file.h"
#include "common/options/number_text.h"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little, "binary clouds are written as the machine holds floats");
static_assert(sizeof(Eigen::Vector3f) == 12);

constexpr std::size_t kMaxCloudBytes = std::size_t{4} << 30;

std::string HeaderOf(std::size_t points, CloudFormat format) {
  const std::string count = std::to_string(points);
  if (format == CloudFormat::kPly || format == CloudFormat::kPlyText) {
    return std::string("ply\nformat ") + (format == CloudFormat::kPly ? "binary_little_endian" : "ascii") +
           " 1.0\ncomment written by cairn: map frame, metres, z up\nelement vertex " + count +
           "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  }
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
         "WIDTH " +
         count + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + count + "\nDATA " +
         (format == CloudFormat::kPcd ? "binary" : "ascii") + "\n";
}

void AppendText(const Eigen::Vector3f& point, std::string* text) {
  for (int axis = 0; axis < 3; ++axis) *text += ExactText(point(axis)) + (axis < 2 ? ' ' : '\n');
}

}  // namespace

Result<CloudFormat> CloudFormatOf(const std::filesystem::path& path, bool text) {
  const std::string extension = path.extension().string();
  if (extension == ".ply") return text ? CloudFormat::kPlyText : CloudFormat::kPly;
  if (extension == ".pcd") return text ? CloudFormat::kPcdText : CloudFormat::kPcd;
  return Fail(StatusCode::kInvalidArgument, path.string() + ": a cloud's file ends in .ply or .pcd");
}

std::string EncodeCloud(const PointCloud& cloud, CloudFormat format) {
  std::string bytes = HeaderOf(cloud.size(), format);
  if (format == CloudFormat::kPlyText || format == CloudFormat::kPcdText) {
    for (const Eigen::Vector3f& point : cloud) AppendText(point, &bytes);
  } else if (!cloud.empty()) {
    bytes.append(reinterpret_cast<const char*>(cloud.data()), cloud.size() * sizeof(Eigen::Vector3f));
  }
  return bytes;
}

Result<void> WriteCloud(const PointCloud& cloud, CloudFormat format, const std::filesystem::path& path) {
  return WriteFileAtomically(path, EncodeCloud(cloud, format));
}

Result<PointCloud> ReadCloud(const std::filesystem::path& path) {
  const auto bytes = ReadWholeFile(path, kMaxCloudBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  auto cloud = DecodeCloud({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  if (!cloud) return Fail(cloud.error().code, path.string() + ": " + cloud.error().message);
  return cloud;
}

}  // namespace cairn
