// Turns our parsers (Result<T> of a text) into options of the command line: what does not parse is a usage error that
// carries the parser's message.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "common/status.h"

namespace cairn::client {

template <typename T, typename Parser>
CLI::Option* AddParsed(CLI::App& app, const std::string& name, T& value, Parser parser, const std::string& help,
                       const std::string& type_name) {
  return app
      .add_option_function<std::string>(
          name,
          [&value, parser, name](const std::string& text) {
            auto parsed = parser(text);
            if (!parsed) throw CLI::ValidationError(name, parsed.error().message);
            value = *parsed;
          },
          help)
      ->type_name(type_name);
}

}  // namespace cairn::client
