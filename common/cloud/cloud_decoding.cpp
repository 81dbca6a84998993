// DecodeCloud of cloud_file.h: headers of PLY and PCD into one layout of a point, then points by that layout.
#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <optional>
#include <string>

#include "common/cloud/cloud_file.h"

namespace cairn {
namespace {

constexpr std::size_t kMaxPoints = 500'000'000;
constexpr int kMaxFields = 64;

tl::unexpected<Status> Bad(const std::string& why) {
  return Fail(StatusCode::kInvalidArgument, why);
}

// The lines of a header and the words of a line.
struct Text {
  std::string_view rest;

  std::optional<std::string_view> Line() {
    const auto end = rest.find('\n');
    if (end == std::string_view::npos) return std::nullopt;
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end + 1);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    return line;
  }
};

std::string_view Word(std::string_view* line) {
  const auto first = line->find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) {
    *line = {};
    return {};
  }
  const auto end = std::min(line->find_first_of(" \t\r\n", first), line->size());
  const std::string_view word = line->substr(first, end - first);
  line->remove_prefix(end);
  return word;
}

template <typename Number>
std::optional<Number> NumberOf(std::string_view word) {
  Number value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

struct Layout {
  bool text = false;
  std::size_t points = 0;
  int fields = 0;                              // Numbers of a point in text.
  std::size_t stride = 0;                      // Bytes of a point in binary.
  std::array<int, 3> column{-1, -1, -1};       // Where x, y and z are among the numbers of a line (text).
  std::array<std::size_t, 3> offset{0, 0, 0};  // Where they are among the bytes of a point (binary).

  // Takes one field in turn; false if there are too many.
  bool AddField(std::string_view name, std::size_t bytes, bool is_float) {
    if (fields >= kMaxFields) return false;
    if (name.size() == 1 && name[0] >= 'x' && name[0] <= 'z' && is_float && bytes == 4) {
      const auto axis = static_cast<std::size_t>(name[0] - 'x');
      column[axis] = fields;
      offset[axis] = stride;
    }
    ++fields;
    stride += bytes;
    return true;
  }
  [[nodiscard]] bool complete() const { return column[0] >= 0 && column[1] >= 0 && column[2] >= 0; }
};

std::size_t PlyBytes(std::string_view type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "int" || type == "uint" || type == "float" || type == "int32" || type == "uint32" || type == "float32")
    return 4;
  return type == "double" || type == "float64" ? 8 : 0;
}

Result<Layout> PlyHeader(Text& text) {
  Layout layout;
  bool in_vertex = false, format = false, vertex = false;
  while (auto line = text.Line()) {
    std::string_view rest = *line;
    const std::string_view key = Word(&rest);
    if (key == "end_header") {
      if (!format || !vertex || !layout.complete()) return Bad("PLY: no format, or no vertices with float x, y, z");
      return layout;
    }
    if (key == "format") {
      const std::string_view kind = Word(&rest);
      if (kind != "ascii" && kind != "binary_little_endian") return Bad("PLY: format must be ascii or little-endian");
      layout.text = kind == "ascii";
      format = true;
    } else if (key == "element") {
      in_vertex = Word(&rest) == "vertex";
      if (in_vertex == vertex)
        return Bad("PLY: the vertices must come first");  // They are read from the start of the body.
      if (!in_vertex) continue;
      const auto count = NumberOf<std::size_t>(Word(&rest));
      if (!count || *count > kMaxPoints) return Bad("PLY: number of vertices");
      layout.points = *count;
      vertex = true;
    } else if (key == "property" && in_vertex) {
      const std::string_view type = Word(&rest);
      const std::size_t bytes = PlyBytes(type);
      if (bytes == 0 || !layout.AddField(Word(&rest), bytes, type == "float" || type == "float32"))
        return Bad("PLY: property of a vertex");
    }
  }
  return Bad("PLY: the header does not end");
}

Result<Layout> PcdHeader(Text& text) {
  Layout layout;
  std::string_view names, sizes, types, counts;
  bool points = false;
  while (auto line = text.Line()) {
    std::string_view rest = *line;
    const std::string_view key = Word(&rest);
    if (key == "FIELDS") names = rest;
    if (key == "SIZE") sizes = rest;
    if (key == "TYPE") types = rest;
    if (key == "COUNT") counts = rest;
    if (key == "POINTS") {
      const auto count = NumberOf<std::size_t>(Word(&rest));
      if (!count || *count > kMaxPoints) return Bad("PCD: number of points");
      layout.points = *count;
      points = true;
    }
    if (key != "DATA") continue;
    const std::string_view kind = Word(&rest);
    if (kind != "ascii" && kind != "binary") return Bad("PCD: data must be ascii or binary");
    layout.text = kind == "ascii";
    for (std::string_view name = Word(&names); !name.empty(); name = Word(&names)) {
      const auto size = NumberOf<std::size_t>(Word(&sizes));
      const std::string_view type = Word(&types), count = Word(&counts);
      if (!size || *size == 0 || *size > 8 || (!count.empty() && count != "1") ||
          !layout.AddField(name, *size, type == "F"))
        return Bad("PCD: fields");
    }
    if (!points || !layout.complete()) return Bad("PCD: no points with 4-byte floats x, y, z");
    return layout;
  }
  return Bad("PCD: the header does not end");
}

Result<PointCloud> TextPoints(std::string_view body, const Layout& layout) {
  PointCloud cloud;
  cloud.reserve(std::min(layout.points, body.size() / 6 + 1));  // "0 0 0\n": a short body cannot make us allocate.
  for (std::size_t i = 0; i < layout.points; ++i) {
    Eigen::Vector3f point;
    for (int field = 0; field < layout.fields; ++field) {
      const std::string_view word = Word(&body);
      if (word.empty()) return Bad("the file ends after " + std::to_string(i) + " points");
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (layout.column[axis] != field) continue;
        const auto value = NumberOf<float>(word);
        if (!value) return Bad("point " + std::to_string(i) + ": not a number");
        point(static_cast<Eigen::Index>(axis)) = *value;
      }
    }
    cloud.push_back(point);
  }
  return cloud;
}

Result<PointCloud> BinaryPoints(std::string_view body, const Layout& layout) {
  if (body.size() / layout.stride < layout.points)
    return Bad("the file ends after " + std::to_string(body.size() / layout.stride) + " points");
  PointCloud cloud(layout.points);
  for (std::size_t i = 0; i < layout.points; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      std::memcpy(&cloud[i](static_cast<Eigen::Index>(axis)), body.data() + i * layout.stride + layout.offset[axis], 4);
  return cloud;
}

}  // namespace

Result<PointCloud> DecodeCloud(std::string_view bytes) {
  Text text{bytes};
  const bool ply = bytes.substr(0, 4) == "ply\n" || bytes.substr(0, 5) == "ply\r\n";
  if (ply) static_cast<void>(text.Line());
  const auto layout = ply ? PlyHeader(text) : PcdHeader(text);
  if (!layout) return tl::unexpected(layout.error());
  return layout->text ? TextPoints(text.rest, *layout) : BinaryPoints(text.rest, *layout);
}

}  // namespace cairn
