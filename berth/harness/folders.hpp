/// Where the random worlds have the description files of their devices.
#pragma once

#include <string>

namespace berth::harness {

/// Both must exist as long as a world is made or run; no slash at their ends.
struct Folders {
  std::string examples;  ///< has pump.eds and pump.dcf, those of examples/eds
  std::string own;       ///< descriptions are written here while a world is drawn; the same folder may be `examples`
  [[nodiscard]] std::string example(const std::string& name) const { return examples + "/" + name; }
};

}  // namespace berth::harness
