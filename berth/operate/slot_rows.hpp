/// The slot table in columns, for users: `berth status`, the final output of `berth up`, and its live table.
///
/// bus, id, slot, state, NMT, heard, EMCY, since, type, serial. A column is omitted if it is empty for all slots. If
/// the rows are wider than the terminal, columns are dropped in this order: since, type, heard, NMT, serial, bus; then
/// long names are cut. `--json` and `berth status SLOT` show everything.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "berth/operate/report.hpp"

namespace berth::operate {

struct SlotRowOptions {
  std::size_t width = 80;            ///< columns of the terminal
  std::optional<rt::Time> now = {};  ///< to show how long ago a device was heard
  bool bus = true;                   ///< false: no such column if all slots are on one bus
  std::size_t widest_name = 64;      ///< of a slot or a bus
};

class SlotRows {
 public:
  SlotRows(const std::vector<SlotReport>& slots, const SlotRowOptions& options);
  [[nodiscard]] std::string heading() const;
  [[nodiscard]] std::string row(const SlotReport& slot) const;

 private:
  enum class Kind { bus, id, name, state, nmt, heard, emcy, since, type, serial };
  struct Column {
    Kind kind;
    std::size_t width;
  };
  [[nodiscard]] static const char* head(Kind kind) noexcept;
  [[nodiscard]] std::string cell(Kind kind, const SlotReport& slot) const;
  [[nodiscard]] std::string line(const std::vector<std::string>& cells) const;
  [[nodiscard]] std::size_t width() const noexcept;
  void fit();

  SlotRowOptions options_;
  std::vector<Column> columns_;
};

/// How long ago, in six columns: "0.4 s", "12 min", "3 h".
[[nodiscard]] std::string age_cell(rt::Duration age);

/// "2310h", "2310h x12".
[[nodiscard]] std::string emcy_cell(const EmcyReport& emcy);

/// The slot table with a heading, one line per slot; then each reason once, with its slots. `now`: to show how long ago
/// each device was heard.
[[nodiscard]] std::vector<std::string> to_table(const std::vector<SlotReport>& slots,
                                                std::optional<rt::Time> now = std::nullopt);
/// The reasons of these slots, each once: "left, right: question: ...". "field/left" when there are several buses.
[[nodiscard]] std::vector<std::string> reasons_of(const std::vector<SlotReport>& slots);

}  // namespace berth::operate
