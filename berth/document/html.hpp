/// Pieces of HTML. All text goes through `markup` (base/words.hpp), because names come from users or from any file.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace berth::document {

/// A whole page: no script, no external content. `body` is HTML. `up`: link back to `index.html`; not on that page.
[[nodiscard]] std::string page(std::string_view title, const std::string& body, bool up = true);

/// A table, row by row. Cells are text, except `html`.
class Table {
 public:
  explicit Table(const std::vector<std::string>& heads);
  Table& cell(std::string_view text);
  Table& number(std::string_view text);
  Table& html(std::string_view made);
  void end_row();
  /// Empty if there is no row.
  [[nodiscard]] std::string made() const;

 private:
  std::string head_;
  std::string rows_;
  std::string row_;
};

}  // namespace berth::document
