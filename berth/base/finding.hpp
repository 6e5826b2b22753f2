/// Remarks of a parser about a user's file (EDS, machine.toml, plant.toml).
#pragma once

#include <string>
#include <vector>

namespace berth {

/// One remark about one place in a file. `line` and `column` count from 1; 0 = the whole file.
struct Finding {
  enum class Severity { note, warning, error };
  Severity severity = Severity::error;
  std::string file;
  int line = 0;
  int column = 0;
  std::string key;      ///< "[2000sub1] LowLimit" or "slot[2].type"
  std::string message;  ///< what is there and why it matters
  std::string fix;      ///< what to do; may be empty

  friend bool operator==(const Finding&, const Finding&) = default;
};

using Findings = std::vector<Finding>;

/// "machine.toml:12:3: error: slot[2].id: 200 is not a node-ID; use 1 to 127".
[[nodiscard]] std::string to_string(const Finding& finding);

/// True when one finding has severity `error`: the file cannot be used.
[[nodiscard]] bool has_errors(const Findings& findings) noexcept;

}  // namespace berth
