/// Manual pages, as troff with the macros of man(7), made from what the parser knows (described.hpp).
#pragma once

#include <string>
#include <vector>

#include "described.hpp"

namespace berth::cli {

struct ManPage {
  std::string name;  ///< "berth-sdo-read"; its file is "berth-sdo-read.1"
  std::string text;
};

/// The page of this verb alone. `date`: "2026-11-30", or empty.
[[nodiscard]] ManPage man_page(const VerbText& verb, const std::string& date);
/// Those of this verb and of all below it.
[[nodiscard]] std::vector<ManPage> man_pages(const VerbText& verb, const std::string& date);

}  // namespace berth::cli
