#include "common/map/map_lines.h"

#include <algorithm>
#include <cmath>

#include "common/file/atomic_file.h"
#include "common/options/number_text.h"
#include "common/sensor/log_fields.h"

namespace cairn {
namespace {

constexpr double kLeastLength_m = 1e-3, kReach_m = 1e6;
constexpr std::size_t kMaxBytes = 4u << 20, kMaxLines = 20'000;
constexpr const char* kNoLine = "a line is at least a millimetre long and within 1000 km";
constexpr std::string_view kHeader = "cairn-map-lines";

bool IsLine(const MapLine& line) {
  return line.a.allFinite() && line.b.allFinite() && line.a.cwiseAbs().maxCoeff() <= kReach_m &&
         line.b.cwiseAbs().maxCoeff() <= kReach_m && (line.b - line.a).norm() >= kLeastLength_m;
}

}  // namespace

Result<std::vector<MapLine>> ParseMapLines(std::string_view text, const std::string& source) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  std::vector<MapLine> lines;
  bool header = false;
  for (int number = 1; !text.empty(); ++number) {
    const std::string_view whole = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(whole.size() + 1, text.size()));
    const std::string_view statement = whole.substr(0, whole.find('#'));
    if (statement.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    const auto fail = [&](const std::string& why) {
      return Fail(StatusCode::kInvalidArgument, source + ":" + std::to_string(number) + ": " + why);
    };
    LogFields fields(statement);
    const std::string_view kind = fields.Word("a statement");
    if (!header) {
      const bool known = kind == kHeader && fields.Count("version", 1, 1) == 1;
      fields.End();
      if (!known || !fields.problem().empty()) return fail("the first statement must be `cairn-map-lines 1`");
      header = true;
      continue;
    }
    if (kind != "wall" && kind != "side") return fail("neither `wall` nor `side`: '" + Shown(kind) + "'");
    MapLine line;
    line.a.x() = fields.Real("AX");
    line.a.y() = fields.Real("AY");
    line.b.x() = fields.Real("BX");
    line.b.y() = fields.Real("BY");
    fields.End();
    if (!fields.problem().empty()) return fail(fields.problem());
    if (!IsLine(line)) return fail(kNoLine);
    lines.push_back(line);
    if (kind == "wall") lines.push_back({line.b, line.a});
    if (lines.size() > kMaxLines) return fail("more than 20000 lines (a wall is two)");
  }
  if (!header)
    return Fail(StatusCode::kInvalidArgument, source + ": empty; the first statement must be `cairn-map-lines 1`");
  if (lines.empty()) return Fail(StatusCode::kInvalidArgument, source + ": no lines");
  return lines;
}

Result<std::vector<MapLine>> ReadMapLines(const std::filesystem::path& path) {
  const auto bytes = ReadWholeFile(path, kMaxBytes);
  if (!bytes) return tl::unexpected<Status>(bytes.error());
  return ParseMapLines({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path.string());
}

Result<void> WriteMapLines(const std::vector<MapLine>& lines, const std::filesystem::path& path) {
  if (lines.empty()) return Fail(StatusCode::kFailedPrecondition, "the map has no lines");
  std::string text = std::string(kHeader) + " 1\n# Seen from the left of the way from A to B: side AX AY BX BY\n";
  for (const MapLine& line : lines) {
    if (!IsLine(line)) return Fail(StatusCode::kInvalidArgument, kNoLine);
    text += "side " + ExactText(line.a.x()) + ' ' + ExactText(line.a.y()) + ' ' + ExactText(line.b.x()) + ' ' +
            ExactText(line.b.y()) + '\n';
  }
  return WriteFileAtomically(path, text);
}

std::vector<MapLine> LinesNear(const std::vector<MapLine>& map, const Eigen::Vector2d& p_map, double reach_m) {
  std::vector<MapLine> near;
  for (const MapLine& line : map) {
    const Eigen::Vector2d way = line.b - line.a;
    const double share = std::clamp(way.dot(p_map - line.a) / way.squaredNorm(), 0.0, 1.0);
    if ((line.a + share * way - p_map).norm() < reach_m) near.push_back(line);
  }
  return near;
}

}  // namespace cairn
