// Whether a YAML text holds more than the one document that YAML::Load reads. Stateless and thread-safe.
#pragma once

#include <optional>
#include <string>

namespace cairn {

// The line, counted from 0, where a second document begins. Throws YAML::Exception where the text is not YAML.
// (YAML::LoadAll would tell as well, but it never ends on a text such as ", a".)
[[nodiscard]] std::optional<int> LineAfterFirstDocument(const std::string& text);

}  // namespace cairn
