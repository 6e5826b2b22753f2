/// An option whose value is a time.
#pragma once

#include <chrono>
#include <functional>
#include <string>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace berth::cli {

/// Takes "30" (seconds), "30 s" or "500 ms", longer than 0; anything else is wrong usage.
CLI::Option* time_option(CLI::App& sub, const std::string& name, std::function<void(std::chrono::nanoseconds)> take,
                         const std::string& help);

}  // namespace berth::cli
