// Fills an options tree from YAML text and `key=value` overrides, prints it, and lists every key. All keys have
// defaults; an unknown key, a wrong type or a value out of range is an error that names source, line, full dotted key,
// the value and the allowed range, and suggests the nearest known key. So is a key alone, without a value: only a
// section may be empty (`slam:` with every line below it commented out). A file is one YAML document. In a file the key
// `expert` is a heading only: what stands below it counts as if it stood at the top.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/status.h"

namespace cairn {

// The line, counted from 0, where a second document begins, which YAML::Load would not read. Throws YAML::Exception
// where the text is not YAML. (YAML::LoadAll would tell as well, but it never ends on a text such as ", a".)
[[nodiscard]] std::optional<int> LineAfterFirstDocument(const std::string& text);

using VisitOptions = std::function<void(OptionVisitor&)>;

// `source` names the text in errors ("cairnd.yaml", "--set").
[[nodiscard]] Result<void> ApplyYaml(const std::string& text, const std::string& source, const VisitOptions& visit);
[[nodiscard]] Result<void> ApplyYamlFile(const std::filesystem::path& path, const VisitOptions& visit);
[[nodiscard]] Result<void> ApplySet(const std::vector<std::string>& assignments, const VisitOptions& visit);

// The whole tree as YAML with comments (meaning, unit, range); ApplyYaml reads it back to the same values. Where fields
// are marked ForOperators, these come first and all others stand below the heading `expert:`.
[[nodiscard]] std::string PrintYaml(const VisitOptions& visit);

// The rules between fields (OptionVisitor::Require) on the values the tree holds now. The first broken one is the
// error.
[[nodiscard]] Result<void> CheckRules(const VisitOptions& visit);

}  // namespace cairn
