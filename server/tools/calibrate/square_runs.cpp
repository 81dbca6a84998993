#include "server/tools/calibrate/square_runs.h"

#include <array>
#include <charconv>
#include <cmath>
#include <string>

#include "common/file/atomic_file.h"

namespace cairn::server {
namespace {

constexpr std::string_view kHeader = "direction,floor,abs_x,abs_y,abs_theta,calc_x,calc_y,calc_theta";
constexpr std::size_t kMaxBytes = 16u << 20;
constexpr double kMaxValue = 1e4;

std::string_view Trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::vector<std::string_view> Fields(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const auto comma = line.find(',');
    fields.push_back(Trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

tl::expected<double, std::string> Number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value) || std::abs(value) > kMaxValue)
    return tl::unexpected("'" + std::string(text.substr(0, 40)) + "' is not a number within +-10000");
  return value;
}

tl::expected<void, std::string> TakeRun(std::string_view line, SquareRuns& runs) {
  const auto fields = Fields(line);
  if (fields.size() != 8) return tl::unexpected("has " + std::to_string(fields.size()) + " fields, not 8");
  if (fields[0] != "cw" && fields[0] != "ccw") return tl::unexpected(std::string("direction must be cw or ccw"));
  if (fields[1] != "smooth" && fields[1] != "bumps")
    return tl::unexpected(std::string("floor must be smooth or bumps"));
  std::array<double, 6> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto number = Number(fields[i + 2]);
    if (!number) return tl::unexpected(number.error());
    numbers[i] = *number;
  }
  const slam::SquareRun run{fields[0] == "cw",
                            {numbers[0], numbers[1], WrapAngle(numbers[2])},
                            {numbers[3], numbers[4], WrapAngle(numbers[5])}};
  (fields[1] == "smooth" ? runs.smooth : runs.bumpy).push_back(run);
  return {};
}

}  // namespace

Result<SquareRuns> ParseSquareRuns(std::string_view text, const std::string& source) {
  SquareRuns runs;
  bool header = false;
  for (int number = 1; !text.empty(); ++number) {
    const auto end = text.find('\n');
    const std::string_view line = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    const auto fail = [&](const std::string& why) {
      return Fail(StatusCode::kInvalidArgument, source + ":" + std::to_string(number) + ": " + why);
    };
    if (!header) {
      if (line != kHeader) return fail("the first line must be `" + std::string(kHeader) + "`");
      header = true;
    } else if (const auto taken = TakeRun(line, runs); !taken) {
      return fail(taken.error());
    }
  }
  if (runs.smooth.empty()) return Fail(StatusCode::kInvalidArgument, source + ": no runs on a smooth floor");
  return runs;
}

Result<SquareRuns> ReadSquareRuns(const std::filesystem::path& path) {
  const auto bytes = ReadWholeFile(path, kMaxBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  return ParseSquareRuns({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path.string());
}

}  // namespace cairn::server
