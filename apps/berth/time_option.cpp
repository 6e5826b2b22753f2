#include "time_option.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <utility>

#include "berth/text/quantity.hpp"

namespace berth::cli {

// The check takes the value: a time that is none is then told as every wrong value is.
CLI::Option* time_option(CLI::App& sub, const std::string& name, std::function<void(std::chrono::nanoseconds)> take,
                         const std::string& help) {
  const auto read = [take = std::move(take)](const std::string& text) {
    auto time = text::parse_duration(text);
    if (!time) time = text::parse_duration(text + " s");
    if (!time || time->count() <= 0) return fmt::format("\"{}\" is no time; write 30, \"30 s\" or \"500 ms\"", text);
    take(*time);
    return std::string();
  };
  return sub
      .add_option_function<std::string>(
          name, [](const std::string&) {}, help)
      ->check(CLI::Validator(read, "TIME"));
}

}  // namespace berth::cli
