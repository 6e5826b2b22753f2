/// What differs between two texts of one machine file, in the words of the file: for a user who changed it while the
/// machine runs.
#pragma once

#include <string>
#include <vector>

#include "berth/text/toml.hpp"

namespace berth::design {

/// One key. Tables of `[[slot]]`, `[[link]]` and the like are matched by `name`, else by their order.
struct Difference {
  std::string table;  ///< "slot s5", "bus.backbone"; empty: the root
  std::string key;    ///< in `table`; empty: the whole table came or went
  text::Place place;  ///< in the later text; of a key that went: its table's, or the file as a whole
  bool came = false;
  bool went = false;

  friend bool operator==(const Difference&, const Difference&) = default;
};
/// "slot s5: spares", "slot s7 is new", "bus.backbone: bitrate is gone".
[[nodiscard]] std::string to_string(const Difference& difference);

/// In the order of the later text; what went comes last in its table. Ignores comments, order and ways of writing.
[[nodiscard]] std::vector<Difference> differences(const text::Value& before, const text::Value& now);

}  // namespace berth::design
