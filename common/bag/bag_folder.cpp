#include "common/bag/bag_folder.h"

#include <yaml-cpp/yaml.h>

#include <fstream>
#include <iterator>
#include <string>
#include <system_error>

namespace cairn::bag {
namespace {

constexpr std::uintmax_t kMaxMetadataBytes = 16 << 20;

Result<std::vector<std::string>> FileNames(const std::filesystem::path& metadata) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(metadata, error))
    return Fail(StatusCode::kNotFound, metadata.string() +
                                           ": no such file; `ros2 bag reindex` makes it, and without "
                                           "it the files of the bag can be given one by one");
  if (std::filesystem::file_size(metadata, error) > kMaxMetadataBytes)
    return Fail(StatusCode::kInvalidArgument, metadata.string() + ": longer than 16 MiB");
  std::ifstream file(metadata);
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  try {
    return YAML::Load(text)["rosbag2_bagfile_information"]["relative_file_paths"].as<std::vector<std::string>>();
  } catch (const YAML::Exception& why) {
    return Fail(StatusCode::kInvalidArgument, metadata.string() + ": it names no files of a bag: " + why.what());
  }
}

}  // namespace

Result<std::vector<std::filesystem::path>> FilesOf(const std::filesystem::path& bag) {
  std::error_code error;
  if (!std::filesystem::is_directory(bag, error)) return std::vector{bag};
  const auto names = FileNames(bag / "metadata.yaml");
  if (!names) return tl::unexpected(names.error());
  if (names->empty()) return Fail(StatusCode::kInvalidArgument, bag.string() + ": a bag without files");
  std::vector<std::filesystem::path> files;
  for (const std::string& name : *names) {
    std::filesystem::path file = bag / std::filesystem::path(name).filename();
    if (file.extension() == ".zstd" && std::filesystem::exists(std::filesystem::path(file).replace_extension(), error))
      file.replace_extension();
    files.push_back(std::move(file));
  }
  return files;
}

}  // namespace cairn::bag
