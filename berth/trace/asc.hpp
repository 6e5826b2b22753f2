/// Vector's ASCII log, as CANalyzer and CANoe write it, and log2asc of can-utils.
///
///     date Fri Jul 10 06:17:32.249 2015
///     base hex  timestamps absolute
///     no internal events logged
///     Begin Triggerblock Fri Jul 10 06:17:32.249 2015
///        0.000713 1  7E5             Rx   d 8 51 00 00 00 00 80 00 00
///        0.001001 1  1F900135x       Rx   d 0
///        0.001400 1  701             Tx   r 1
///        0.001900 CANFD   1 Rx  123                                   1 0 2  2 AA BB ...
///        0.002100 1  ErrorFrame
///     End TriggerBlock
///
/// Read: `base hex` and `base dec` (identifiers and data), absolute and relative timestamps (the latter since the
/// previous event), the date with English and German names, with or without milliseconds, 24 hours or am/pm, and taken
/// as UTC, because the file does not say; without a date, time counts from 0. Symbolic names of CANFD lines are
/// ignored. Every other event (statistics, chip status, J1939TP, LIN, requests `TxRq`) is counted in one note at the
/// end. A line that is neither an event nor part of the head is an error.
///
/// Channel N is the bus "can<N-1>", as log2asc numbers them, unless a comment of Berth's names it:
///
///     // berth: channel 1 is backbone
///
/// Written: hexadecimal, absolute, microseconds; channels in the order in which the buses appear. Lost: nanoseconds; an
/// error frame's content (`ErrorFrame` only); an unknown direction (becomes `Rx`).
#pragma once

#include <string>
#include <vector>

#include "berth/trace/lines.hpp"

namespace berth::trace {

class AscReader final : public LineReader {
 public:
  explicit AscReader(std::string file) : LineReader(std::move(file)) {}

 private:
  void line(std::string_view line) override;
  void over() override;
  [[nodiscard]] bool head(std::string_view line);
  void date(std::string_view text);
  void comment(std::string_view text);
  [[nodiscard]] bool event();
  [[nodiscard]] std::optional<rt::Duration> time();
  void classic(unsigned channel);
  void flexible();
  void error_frame(unsigned channel);
  [[nodiscard]] bool identifier(std::string_view word, std::size_t column);
  [[nodiscard]] bool data(std::string_view last);
  [[nodiscard]] std::optional<std::uint32_t> row_flags();
  void keep_on(unsigned channel);
  [[nodiscard]] std::string_view word();
  [[nodiscard]] std::optional<unsigned> number(std::string_view word, unsigned base, unsigned most) const noexcept;
  void wrong(std::string_view word, std::string message);

  bool decimal_ = false;
  bool relative_ = false;
  bool dated_ = false;
  rt::Duration start_{};   // of the measurement
  rt::Duration latest_{};  // of the previous event, since `start_`
  std::uint64_t others_ = 0;
  std::string_view line_;
  std::size_t at_ = 0;  // after the last word taken
  Entry entry_;
  std::vector<std::pair<unsigned, std::uint16_t>> channels_;  // channel and its bus
  std::vector<std::pair<unsigned, std::string>> names_;       // by comments
};

class AscWriter final : public Writer {
 public:
  void write(const Entry& entry, std::string_view bus, std::string& out) override;
  void finish(std::string& out) override;

 private:
  void begin(rt::Duration first, std::string& out);

  bool begun_ = false;
  rt::Duration start_{};
  LineNames names_;
};

}  // namespace berth::trace
